"""proto/litags/v1 keeps buf's rules, and what was frozen as v1.

    python3 tests/proto/buf_test.py --freeze    adds to v1.binpb what was added to the protos

Run by CTest with LITAGS_SOURCE and LITAGS_NPM_FOLDER in the environment. buf comes from npm, by the
lock file beside this one; without npm or a registry the test is skipped.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])
HERE = SOURCE / "tests/proto"
FROZEN = HERE / "v1.binpb"
WORK = pathlib.Path(os.environ["LITAGS_NPM_FOLDER"])

sys.path.insert(0, str(SOURCE / "tests/support"))
import npm_packages  # noqa: E402


def buf(*args):
    return subprocess.run([WORK / "node_modules/.bin/buf", *map(str, args), "--config",
                           HERE / "buf.yaml"], capture_output=True, text=True)


def breaking(protos):
    return buf("breaking", protos, "--against", FROZEN, "--against-config", HERE / "buf.yaml")


class Protos(unittest.TestCase):

    def test_the_style_is_bufs(self):
        run = buf("lint", SOURCE / "proto")
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)

    def test_nothing_that_was_frozen_changes(self):
        run = breaking(SOURCE / "proto")
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)

    def test_a_change_would_be_found(self):
        changes = (
            ("job.proto", "int32 attempts = 3;", "int32 tries = 3;"),
            ("job.proto", "int64 last_event = 12;", "int32 last_event = 12;"),
            ("job.proto", "METHOD_3DGS = 2;", "METHOD_3DGS = 9;"),
            ("reconstruction_service.proto", "rpc GetJob(GetJobRequest) returns (Job);", ""),
        )
        for name, old, new in changes:
            with self.subTest(old), tempfile.TemporaryDirectory() as folder:
                protos = pathlib.Path(shutil.copytree(SOURCE / "proto", pathlib.Path(folder, "p")))
                path = protos / "litags/v1" / name
                text = path.read_text()
                self.assertIn(old, text)
                path.write_text(text.replace(old, new))
                run = breaking(protos)
                self.assertEqual(run.returncode, 100, run.stdout + run.stderr)


if __name__ == "__main__":
    npm_packages.install_or_skip(HERE, WORK)
    if sys.argv[1:] == ["--freeze"]:
        if (broken := breaking(SOURCE / "proto")).returncode != 0:
            sys.exit(broken.stdout + broken.stderr + "v1.binpb stays as it is")
        print(buf("build", SOURCE / "proto", "--exclude-source-info", "-o", FROZEN).stderr)
    else:
        unittest.main(verbosity=2)
