"""client/typescript, with packages from npm, over a connection that breaks."""

import os
import pathlib
import subprocess
import sys
import unittest

import examples
import harness

sys.path.insert(0, str(examples.SOURCE / "tests/support"))
import npm_packages  # noqa: E402

HERE = examples.SOURCE / "client/typescript"
WORK = pathlib.Path(os.environ["LITAGS_NPM_FOLDER"])


class TypeScript(examples.Example, examples.Refused, harness.ServiceTest):
    command = ("node", WORK / "out/reconstruct.js")


class SilentTypeScript(examples.Silent, harness.ServiceTest):
    command = TypeScript.command


class SecureTypeScript(examples.Secure, harness.ServiceTest):
    command = TypeScript.command


class MutualTypeScript(examples.Mutual, harness.ServiceTest):
    command = TypeScript.command


if __name__ == "__main__":
    npm_packages.install_or_skip(HERE, WORK, ("tsconfig.json", "reconstruct.ts"))
    subprocess.run(["npm", "run", "--silent", "build"], cwd=WORK, check=True,
                   env=dict(os.environ, PROTO=str(examples.SOURCE / "proto")))
    unittest.main(verbosity=2)
