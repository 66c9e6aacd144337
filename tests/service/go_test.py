"""client/go/reconstruct, built with Debian's Go packages, over a connection that breaks."""

import atexit
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import examples
import harness

WORK = pathlib.Path(tempfile.mkdtemp(prefix="litags-go-"))
atexit.register(shutil.rmtree, WORK, ignore_errors=True)
CACHE = os.environ["LITAGS_GO_CACHE"]  # kept: building gRPC takes a minute
DEBIANS = pathlib.Path("/usr/share/gocode")
PROGRAM = WORK / "reconstruct"


class Go(examples.Example, examples.Refused, harness.ServiceTest):
    command = (PROGRAM,)


class SilentGo(examples.Silent, harness.ServiceTest):
    command = (PROGRAM,)


class SecureGo(examples.Secure, harness.ServiceTest):
    command = (PROGRAM,)


class MutualGo(examples.Mutual, harness.ServiceTest):
    command = (PROGRAM,)


def missing():
    needed = (("golang-go", shutil.which("go")),
              ("protoc-gen-go", shutil.which("protoc-gen-go")),
              ("protoc-gen-go-grpc", shutil.which("protoc-gen-go-grpc")),
              ("golang-google-grpc-dev", (DEBIANS / "src/google.golang.org/grpc").exists()),
              # Version 1.3, which gRPC also builds with, cannot read the messages.
              ("golang-github-golang-protobuf-1-5-dev",
               (DEBIANS / "src/github.com/golang/protobuf/proto/wire.go").exists()))
    return ", ".join(f"{package} is not installed" for package, there in needed if not there)


def build():
    stubs = WORK / "src"
    stubs.mkdir()
    proto = examples.SOURCE / "proto"
    subprocess.run(["protoc", f"-I{proto}", f"--go_out={stubs}", f"--go-grpc_out={stubs}",
                    *proto.glob("litags/v1/*.proto")], check=True)
    subprocess.run(["go", "build", "-o", PROGRAM, "."],
                   cwd=examples.SOURCE / "client/go/reconstruct", check=True,
                   env=dict(os.environ, GO111MODULE="off", GOPATH=f"{WORK}:{DEBIANS}",
                            GOCACHE=CACHE, GOFLAGS=""))


if __name__ == "__main__":
    if why := missing():
        print("skipped:", why)
        sys.exit(examples.SKIPPED)
    build()
    unittest.main(verbosity=2)
