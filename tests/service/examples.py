"""What the example programs of other languages must do, whatever they are written in."""

import os
import pathlib
import subprocess

import harness

SOURCE = pathlib.Path(__file__).resolve().parents[2]
SKIPPED = 77  # what CTest takes for "skipped": SKIP_RETURN_CODE


class Example:
    """Mixed into a ServiceTest. `command`: the program, without arguments."""

    command = ()

    def start(self, photos, address, iterations):
        self.picture = pathlib.Path(self.folder, "view.png")
        self.scene = pathlib.Path(self.folder, "scene.ply")
        return subprocess.Popen(
            [*map(str, self.command), photos, self.picture, self.scene, str(iterations)],
            env=dict(os.environ, LITAGS_SERVER=address, NO_PROXY="127.0.0.1"),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def finish(self, process):
        try:
            return process.communicate(timeout=harness.PATIENCE_S)
        finally:
            process.kill()

    def test_photos_become_a_picture_and_a_scene_though_the_watch_is_cut(self):
        proxy = harness.CuttableProxy(self.server.port)
        self.addCleanup(proxy.close)
        # The first photo has no camera, and the folder's name means other folders to a shell.
        photos = os.path.join(self.folder, "night [1]")
        os.rename(self.photos(("no-camera.png", "slow.png", "x.png", "y.jpg")), photos)
        process = self.start(photos, proxy.address, 150)
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "RUNNING" in line:
                proxy.cut()
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 0, err)
        self.assertGreaterEqual(proxy.connections, 2)
        # No event twice, and none missing.
        self.assertEqual([sum(state in line for line in lines) for state in
                          ("QUEUED", "RUNNING", "SUCCEEDED")], [1, 1, 1], lines)
        self.assertEqual(harness.png_size(self.picture.read_bytes()), (64, 48))
        self.assertTrue(self.scene.read_bytes().startswith(b"ply\n"))

    def test_what_is_refused_is_said_with_its_reason_and_field(self):
        process = self.start(self.photos(), self.server.address, -1)
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1, err)
        self.assertRegex(err, r"BAD_OPTION\s+options.iterations")

    def test_a_job_that_fails_says_why(self):
        process = self.start(self.photos(("fail.png", "b.png", "c.png")), self.server.address, 40)
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1)
        self.assertIn("take photos that overlap more", err)
