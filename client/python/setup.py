"""Adds litags/v1, the code that protoc makes from the project's .proto files, to the package."""

import pathlib
import shutil
import subprocess
import sys

from setuptools import setup
from setuptools.command.build_py import build_py

PROTO = pathlib.Path(__file__).resolve().parents[2] / "proto"


class BuildWithProtos(build_py):
    def run(self) -> None:
        super().run()
        plugin = shutil.which("grpc_python_plugin")
        if not plugin or not shutil.which("protoc"):
            sys.exit("protoc and grpc_python_plugin are missing: "
                     "apt-get install protobuf-compiler protobuf-compiler-grpc")
        # Not google/rpc: googleapis-common-protos has it, and two copies cannot be imported.
        protos = sorted(PROTO.glob("litags/v1/*.proto"))
        if not protos:
            sys.exit(f"{PROTO} has no litags/v1/*.proto: build in a clone of the project")
        out = "src" if self.editable_mode else self.build_lib
        subprocess.run(["protoc", f"-I{PROTO}", f"--python_out={out}", f"--pyi_out={out}",
                        f"--grpc_out={out}", f"--plugin=protoc-gen-grpc={plugin}", *protos],
                       check=True)
        pathlib.Path(out, "litags/v1/__init__.py").touch()


setup(cmdclass={"build_py": BuildWithProtos})
