"""The short form of kill_rounds.py; tests/crash/run is the long one."""

import os
import random
import sys
import unittest

import deployment
import kill_rounds


def seeds(count):
    """Other seeds each time, printed, unless LITAGS_CRASH_SEED says where to begin."""
    first = int(os.environ.get("LITAGS_CRASH_SEED") or random.randrange(1_000_000))
    print(f"seeds {first}..{first + count - 1}; LITAGS_CRASH_SEED={first} repeats them",
          file=sys.stderr)
    return range(first, first + count)


class Kill(unittest.TestCase):

    def expect_clean(self, workload, rounds):
        """Runs as many rounds; there are enough of them for each victim to be killed."""
        tally = kill_rounds.run_rounds(workload, seeds(rounds), at_once=rounds,
                                       report=lambda text: print(text, file=sys.stderr))
        print(dict(tally.kills), file=sys.stderr)
        self.assertEqual(tally.complaints, [])
        self.assertEqual(tally.rounds, rounds)
        self.assertEqual([v for v in workload.victims if not tally.kills[v]], [], "never killed")

    def test_jobs_survive_any_kill(self):
        self.expect_clean(kill_rounds.fake_workload(), 6)

    def test_training_survives_any_kill_byte_for_byte(self):
        with deployment.scratch() as folder:
            self.expect_clean(kill_rounds.real_workload(folder), 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
