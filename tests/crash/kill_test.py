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

    def expect_clean(self, tally, rounds):
        self.assertEqual(tally.complaints, [])
        self.assertEqual(tally.rounds, rounds)
        print(dict(tally.kills), file=sys.stderr)

    def test_jobs_survive_any_kill(self):
        tally = kill_rounds.run_rounds(kill_rounds.fake_workload(), seeds(6), at_once=6,
                                       report=lambda text: print(text, file=sys.stderr))
        self.expect_clean(tally, 6)

    def test_training_survives_any_kill_byte_for_byte(self):
        with deployment.scratch() as folder:
            tally = kill_rounds.run_rounds(kill_rounds.real_workload(folder), seeds(3), at_once=3,
                                           report=lambda text: print(text, file=sys.stderr))
        self.expect_clean(tally, 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
