"""On a full disk the server starts, however it ended before, and deletes jobs."""

import os
import shutil
import subprocess
import unittest

import grpc

import deployment
import faults_test
import skipping
from harness import rpc

DISK_MB = 64
RESERVE_BYTES = 16 << 20


class FullDisk:
    """The server's data folder is a disk of its own, which stays when the server ends."""

    MOUNT = ""  # shell command that mounts $IMAGE or memory at $DATA

    def setUp(self):
        super().setUp()
        self.data = os.path.join(self.folder, "data")
        os.mkdir(self.data)
        self.hold_disk()
        colmap = self.script("colmap", "echo 'COLMAP 3.8 (a fake)'\n")
        user = [] if os.geteuid() == 0 else ["--user", "--preserve-credentials"]
        self.enter = ["nsenter", "--target", str(self.holder.pid), "--mount", *user]
        self.server = self.deploy("--colmap", colmap, prefix=self.enter)
        client = self.client(self.server)
        self.names = [client.create() for _ in range(3)]
        for name in self.names:
            client.upload(name, deployment.photos())

    def hold_disk(self):
        """A process whose mounts the disk is among, until the test ends."""
        environment = dict(os.environ, DATA=self.data, IMAGE=os.path.join(self.folder, "image"))
        self.holder = subprocess.Popen(
            [*faults_test.OWN_MOUNTS, "sh", "-c", f"{self.MOUNT} && echo mounted && exec cat"],
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        # Ends with its input; its mounts go before the folder does.
        self.stack.callback(self.holder.communicate)
        if self.holder.stdout.readline() != b"mounted\n":
            self.skipTest(f"a small disk cannot be made: {self.holder.stderr.read().decode()}")

    def on_disk(self, command):
        subprocess.run([*self.enter, "sh", "-c", command], cwd="/", check=True)

    def fill(self):
        """To the last block, also where it was filled before. A file system may free blocks late."""
        self.on_disk(f"""cd "{self.data}" && for round in $(seq 50); do
            for size in 1M 4k 1k; do dd if=/dev/zero of=$(mktemp ballast-XXXXXX) bs=$size; done
            sync
            dd if=/dev/zero of=more bs=4k count=1 || {{ rm -f more; exit 0; }}
            rm more
          done 2>/dev/null; exit 1""")

    def check(self):
        return subprocess.run([*self.server.command(), "--check"], capture_output=True, text=True,
                              timeout=60)

    def starts_and_deletes(self):
        checked = self.check()
        self.assertRegex(checked.stdout, r"(?m)^note +store .* is on a full disk: jobs can be deleted", checked)
        self.assertEqual(checked.returncode, 0, checked.stdout)
        self.server.start()
        self.deletes()

    def deletes(self):
        client = self.client(self.server)
        for name in self.names:
            self.fill()
            client.delete(name)
            self.refused(lambda: client.get(name), grpc.StatusCode.NOT_FOUND)
        self.assertEqual(len(client.jobs.ListJobs(rpc.ListJobsRequest()).jobs), 0)

    def test_running_server_deletes_jobs(self):
        self.deletes()

    def test_killed_server_starts_and_deletes_jobs(self):
        self.fill()
        self.server.kill()
        self.assertEqual(self.server.orphans(), {})
        self.fill()
        self.starts_and_deletes()

    def test_stopped_server_starts_and_deletes_jobs(self):
        self.fill()
        self.server.stop()
        self.fill()
        self.starts_and_deletes()

    def test_without_its_reserve_the_server_says_how_much_to_free(self):
        self.server.stop()
        self.on_disk(f'rm "{self.data}/litags.db-reserve"')
        self.fill()
        words = r"the job store .*litags\.db cannot be opened.* free 16 MiB there.*\(DISK_FULL\)"
        checked = self.check()
        self.assertRegex(checked.stdout, rf"(?m)^FAIL +store +{words}")
        self.assertEqual(checked.returncode, 1)
        started = subprocess.run(self.server.command(), capture_output=True, text=True, timeout=60)
        self.assertRegex(started.stderr, words)
        self.assertEqual(started.returncode, 1)

    def test_reserve_is_made_again_once_there_is_room(self):
        reserve = f'"{self.data}/litags.db-reserve"'
        whole = f"test $(stat -c %s {reserve}) = {RESERVE_BYTES}"
        self.on_disk(whole)
        self.fill()
        client = self.client(self.server)
        client.delete(self.names[0])
        self.on_disk(f"! {whole}")
        self.on_disk(f'rm "{self.data}"/ballast-* && sync')
        client.create()
        self.on_disk(whole)


class InMemory(FullDisk, faults_test.FaultTest):
    MOUNT = f'mount -t tmpfs -o size={DISK_MB}m tmpfs "$DATA"'


@unittest.skipIf(os.geteuid() != 0 or not shutil.which("mkfs.ext4"),
                 "an ext4 file system takes root and mkfs.ext4")
class Ext4(FullDisk, faults_test.FaultTest):
    MOUNT = (f'truncate -s {DISK_MB}M "$IMAGE" && mkfs.ext4 -q -m 0 -b 1024 "$IMAGE" && '
             'mount -o loop "$IMAGE" "$DATA"')


if __name__ == "__main__":
    skipping.run_tests()
