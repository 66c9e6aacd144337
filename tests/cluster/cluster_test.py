"""The short form of storm.py; tests/cluster/run is the long one."""

import os
import random
import sys
import unittest

import cluster
import storm

SKIPPED = 77  # what CTest takes for "skipped": SKIP_RETURN_CODE


class Cluster(unittest.TestCase):

    def test_every_job_ends_once_whatever_is_killed_or_cut(self):
        seed = int(os.environ.get("LITAGS_CLUSTER_SEED") or random.randrange(1_000_000))
        print(f"LITAGS_CLUSTER_SEED={seed} repeats it", file=sys.stderr)
        tally = storm.run(storm.fake_workload(iterations=150), seed, jobs=16, seconds=30,
                          report=lambda text: print(text, file=sys.stderr))
        print(tally.row(), file=sys.stderr)
        self.assertEqual(tally.complaints, [])
        self.assertEqual(tally.jobs, 16)
        self.assertEqual([f"{what} of {kind}" for what, kind in storm.SURE
                          if not tally.disturbances[f"{what} of {kind}"]], [], "never happened")


if __name__ == "__main__":
    if why := cluster.missing():
        print("skipped:", why)
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)
