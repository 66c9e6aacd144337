"""A real scene drawn by WebGL in Debian's Chromium: on the page, and as a page of its own.

The steps are in viewer_steps.mjs. Skipped, and says so, without Chromium, without npm, or where
its registry cannot be reached. Pictures go to the folder LITAGS_SCREENSHOTS.
"""

import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest
import urllib.error
import urllib.request

import measure_flight
import npm_packages

HERE = pathlib.Path(__file__).resolve().parent
BIN = pathlib.Path(os.environ["LITAGS_BIN"])
WORK = pathlib.Path(os.environ["LITAGS_NPM_FOLDER"])
PATIENCE_S = 60 * int(os.environ.get("LITAGS_TEST_SLOWER", "1"))


def move_to_map(path):
    """Cameras in the coordinates of a map, which floats are too coarse for."""
    cameras = json.loads(path.read_text())
    for frame in cameras["frames"]:
        for row, offset in zip(frame["transform_matrix"], (500000, 4000000, 20)):
            row[3] += offset
    path.write_text(json.dumps(cameras))


class Viewer(unittest.TestCase):

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="litags-viewer-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        capture = self.folder / "capture"
        subprocess.run([BIN / "litags-sample", capture, "--size", "160x120", "--views", "10"], check=True,
                       stdout=subprocess.DEVNULL)
        move_to_map(capture / "transforms_train.json")
        self.server = measure_flight.Server(BIN, self.folder, 0)
        self.addCleanup(self.server.stop)
        self.job = self.server.trained_job(capture, iterations=150)

    def export(self, *args):
        return subprocess.run([BIN / "litags", "--server", self.server.address, "export", self.job, *args],
                              capture_output=True, text=True)

    def test_the_viewer_draws_what_the_server_draws(self):
        screenshots = pathlib.Path(os.environ.get("LITAGS_SCREENSHOTS", self.folder / "screenshots"))
        screenshots.mkdir(parents=True, exist_ok=True)
        page = self.folder / "site.html"
        done = self.export("-o", page)
        try:
            urllib.request.urlopen(f"{self.server.url}/viewer.js").close()
        except urllib.error.HTTPError:
            self.assertIn("EXPORT_NOT_BUILT", done.stderr)
            self.fail("the programs were built without the viewer")
        self.assertEqual(done.returncode, 0, done.stderr)
        text = page.read_bytes()
        for elsewhere in (b"src=\"http", b"href=\"http", b"@SCENE@", b"@MODULE@"):
            self.assertNotIn(elsewhere, text)
        environment = dict(os.environ, URL=f"{self.server.url}/#/{self.job}/scene", HTML=str(page),
                           CHROMIUM=npm_packages.CHROMIUM, SCREENSHOTS=str(screenshots),
                           HOME=str(self.folder),
                           PATIENCE_MS=str(1000 * PATIENCE_S))
        steps = subprocess.run(["node", WORK / "viewer_steps.mjs"], env=environment)
        self.assertEqual(steps.returncode, 0, "a step failed; see above")


if __name__ == "__main__":
    npm_packages.run_browser_tests(HERE, WORK, "viewer_steps.mjs")
