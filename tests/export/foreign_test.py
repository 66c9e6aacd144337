"""Programs of others read what the export writes, and draw the same from it.

They come from npm, by the lock file beside this one; without npm or a registry the test is skipped.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
BENCH = pathlib.Path(os.environ["LITAGS_BIN"], "litags-bench")
WORK = pathlib.Path(os.environ["LITAGS_NPM_FOLDER"])
SKIPPED = 77

# What a format's numbers lose, dB of pictures of the made-up scene; "PSNR, dB" in docs/export.md is
# of a trained one.
READ = ("ply", "compressed-ply", "splat", "spz", "spz-v4", "sog", "glb")


def install():
    """Why the readers cannot be had, or None."""
    if not shutil.which("npm") or not shutil.which("node"):
        return "node and npm are not installed"
    WORK.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json", "convert.mjs"):
        shutil.copy(HERE / name, WORK)
    done = WORK / "node_modules/.litags-lock"
    lock = (HERE / "package-lock.json").read_text()
    if done.exists() and done.read_text() == lock:
        return None
    try:
        run = subprocess.run(
            ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline",
             "--fetch-retries=0"],
            cwd=WORK, capture_output=True, text=True, timeout=240)
    except subprocess.TimeoutExpired:
        return "npm ci takes too long"
    if run.returncode != 0:
        return "npm ci cannot install the readers: " + run.stderr.strip()[-300:]
    done.write_text(lock)
    return None


class ForeignTest(unittest.TestCase):
    def test_others_read_what_we_read(self):
        report = WORK / "report.json"
        run = subprocess.run(
            [BENCH, "export", "--gaussians", "1500", "--views", "2", "--converter",
             WORK / "convert.mjs", "--json", report, "--out", WORK / "files"],
            capture_output=True, text=True, timeout=250)
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        rows = {row["format"]: row for row in json.loads(report.read_text())["formats"]}
        for name in READ:
            with self.subTest(name):
                ours, others = rows[name]["psnr_db"], rows[name]["psnr_of_others_db"]
                # Both above 60 dB: they differ by rounding only.
                self.assertAlmostEqual(min(ours, 60), min(others, 60), delta=1.0)
        for name in ("usda", "colmap"):
            self.assertNotIn("psnr_of_others_db", rows[name])


if __name__ == "__main__":
    reason = install()
    if reason:
        print("skipped:", reason)
        sys.exit(SKIPPED)
    unittest.main()
