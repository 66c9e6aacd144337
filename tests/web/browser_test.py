"""The page in Debian's Chromium: what a user does, step by step, in browser_steps.mjs.

Skipped, and says so, without Chromium, without npm, or where its registry cannot be reached.
Pictures of the steps go to the folder LITAGS_SCREENSHOTS.
"""

import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

import gateway
import harness

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])
HERE = SOURCE / "tests/web"
WORK = pathlib.Path(os.environ["LITAGS_NPM_FOLDER"])
sys.path.insert(0, str(SOURCE / "tests/support"))
import npm_packages  # noqa: E402



def with_exif(png):
    """The PNG of a photo of 1/30 s at f/1.8 and ISO 800, by a lens of 35 mm."""
    values = struct.pack("<6I", 1, 30, 18, 10, 35, 1)
    at = 26 + 54  # behind a directory with one entry, and one with four
    tags = ((0x829a, 5, at), (0x829d, 5, at + 8), (0x8827, 3, 800), (0x920a, 5, at + 16))
    exif = (b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x8769, 4, 1, 26, 0) + struct.pack("<H", 4)
            + b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
            + struct.pack("<I", 0) + values)
    return png[:33] + harness.png_chunk(b"eXIf", exif) + png[33:]  # behind the header


class Browser(unittest.TestCase):

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="litags-browser-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        made = subprocess.run([f"{harness.BIN}/{harness.SERVER_PROGRAM}", "token", "alice"],
                              capture_output=True, text=True, check=True)
        self.token = made.stdout.strip()
        self.extra = ("--token", made.stderr.split("--token ")[1].strip())
        self.server = gateway.WebServer(str(self.folder), extra=self.extra)
        self.addCleanup(lambda: self.server.stop())

    def restart(self):
        """The same server again, at the same addresses."""
        self.server.kill()
        self.server = gateway.WebServer(str(self.folder), self.server.web_port,
                                        port=self.server.port, extra=self.extra)

    def photos(self, *stems):
        """A folder of photos; their names tell the fake engine what to do."""
        folder = self.folder / "-".join(stems)
        folder.mkdir()
        for seed, stem in enumerate(stems):
            (folder / f"{stem}.png").write_bytes(harness.png(96, 72, seed))
        return folder

    def doubtful_photos(self):
        """Photos of which one says how it was taken, and one is a copy."""
        folder = self.photos("d", "e", "f")
        (folder / "d.png").write_bytes(with_exif(harness.png(96, 72, 0)))
        shutil.copy(folder / "f.png", folder / "f copy.png")
        return folder

    def video(self):
        """A folder with a short clip."""
        photos, folder = self.photos("v1", "v2", "v3"), self.folder / "video"
        folder.mkdir()
        subprocess.run([f"{harness.BIN}/litags-test-video", photos, folder / "night.mov"], check=True)
        return folder

    def test_the_steps(self):
        screenshots = pathlib.Path(os.environ.get("LITAGS_SCREENSHOTS", self.folder / "screenshots"))
        screenshots.mkdir(parents=True, exist_ok=True)
        page = gateway.Client(self.server.web_port)
        self.addCleanup(page.connection.close)
        if b"app.js" not in page.get("/").body:
            self.fail("the server was built without the page")
        environment = dict(
            os.environ, URL=f"http://127.0.0.1:{self.server.web_port}", TOKEN=self.token,
            CHROMIUM=npm_packages.CHROMIUM, SCREENSHOTS=str(screenshots), MESSAGES=gateway.messages(),
            PHOTOS=str(self.photos("a", "b", "c")),
            SLOW=str(self.photos("slow", "b", "c")), VIDEO=str(self.video()),
            DOUBTFUL=str(self.doubtful_photos()), HOME=str(self.folder),
            PATIENCE_MS=str(1000 * harness.PATIENCE_S))
        steps = subprocess.Popen(["node", WORK / "browser_steps.mjs"], env=environment, text=True,
                                 stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        try:
            for line in steps.stdout:
                print(line, end="", flush=True)
                if line.startswith("RESTART"):
                    self.restart()
                    steps.stdin.write("done\n")
                    steps.stdin.flush()
            self.assertEqual(steps.wait(harness.PATIENCE_S), 0, "a step failed; see above")
        finally:
            steps.kill()
            steps.wait()
            steps.stdin.close()
            steps.stdout.close()


if __name__ == "__main__":
    npm_packages.run_browser_tests(HERE, WORK, "browser_steps.mjs", "steps.mjs")
