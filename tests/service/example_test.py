"""client/python/reconstruct.py as its reader would run it, over connections that break."""

import os
import subprocess
import sys
import unittest

import harness

PROGRAM = os.environ["LITAGS_PYTHON_CLIENT"]


class Example(harness.ServiceTest):

    def start(self, photos, address, *more):
        environment = dict(os.environ, PYTHONPATH=os.environ["LITAGS_STUBS"], PYTHONUNBUFFERED="1",
                           no_grpc_proxy="127.0.0.1")
        return subprocess.Popen(
            [sys.executable, "-B", PROGRAM, photos, os.path.join(self.folder, "view.png"),
             "--server", address, *more],
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def finish(self, process):
        try:
            return process.communicate(timeout=harness.PATIENCE_S)
        finally:
            process.kill()

    def test_photos_become_a_picture_though_uploads_and_watches_are_cut(self):
        photos = self.photos(())
        for seed, name in enumerate(("slow.png", "b.png", "c.png")):
            with open(os.path.join(photos, name), "wb") as file:
                file.write(harness.large_png(seed))
        proxy = harness.CuttableProxy(self.server.port, cut_every=2 << 20)
        self.addCleanup(proxy.close)
        process = self.start(photos, proxy.address, "--iterations", "100")
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "JOB_STATE_RUNNING" in line:
                proxy.cut()
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 0, err)
        self.assertGreaterEqual(proxy.connections, 3)
        # No event twice: a run changes its state three times at most.
        self.assertEqual(sum("JOB_STATE_RUNNING" in line for line in lines), 1, lines)
        self.assertIn("b.png in normal light", lines[-1])
        with open(os.path.join(self.folder, "view.png"), "rb") as file:
            self.assertEqual(harness.png_size(file.read()), (64, 48))  # the fake engine's

    def test_what_is_refused_is_said_with_its_reason_and_field(self):
        process = self.start(self.photos(("a.png",)), self.server.address, "--iterations", "-1")
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1)
        self.assertRegex(err, r"INVALID_ARGUMENT \w+, field options.iterations")

    def test_a_job_that_fails_says_why(self):
        process = self.start(self.photos(("fail.png", "b.png", "c.png")), self.server.address)
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1)
        self.assertIn("take photos that overlap more (SFM_TOO_FEW_VIEWS, field images)", err)


if __name__ == "__main__":
    unittest.main(verbosity=2)
