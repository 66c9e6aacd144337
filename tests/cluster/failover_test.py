"""The program litags with two servers of one installation, of which the one in use is killed."""

import json
import os
import subprocess
import tempfile
import threading
import time
import unittest

import deployment
import harness
from deployment import Deployment


class Relay(harness.CuttableProxy):
    """Calls back once so many bytes have come from clients."""

    def __init__(self, port):
        super().__init__(port)
        self.limit, self.callback = None, None

    def at(self, limit, callback):
        self.limit, self.callback = self.sent + limit, callback

    def _count(self, size):
        super()._count(size)
        with self.lock:
            if self.limit is None or self.sent < self.limit:
                return False
            self.limit = None
        self.callback()
        return True


class Failover(unittest.TestCase):

    def setUp(self):
        scratch = deployment.scratch()
        self.folder = scratch.__enter__()
        self.addCleanup(scratch.__exit__, None, None, None)
        self.servers, self.relays = [], []
        for name in ("a", "b"):
            folder = os.path.join(self.folder, name)
            os.mkdir(folder)
            server = Deployment(folder, "--store", f"sqlite://{self.folder}/jobs.db", "--blobs",
                                f"file://{self.folder}/blobs", "--threads", "1",
                                program="litags-fake-server").start()
            self.addCleanup(server.stop)
            relay = Relay(server.port)
            self.addCleanup(relay.close)
            self.servers.append(server)
            self.relays.append(relay)
        self.addresses = ",".join(relay.address for relay in self.relays)

    def litags(self, *args):
        return subprocess.Popen([os.path.join(harness.BIN, "litags"), "--server", self.addresses,
                                 *args], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def ends(self, process):
        out, err = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, f"{out}\n{err}")
        return out

    def photos(self, **large):
        folder = tempfile.mkdtemp(dir=self.folder)
        for name, data in {"slow.png": harness.png(), "p1.png": harness.png(seed=1),
                           "p2.png": harness.png(seed=2), **large}.items():
            with open(os.path.join(folder, name), "wb") as file:
                file.write(data)
        return folder

    def in_use(self, sent_before):
        """The number of the server that clients have talked to since."""
        deadline = time.monotonic() + 60
        while True:
            for number, relay in enumerate(self.relays):
                if relay.sent > sent_before[number]:
                    return number
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)

    def sent(self):
        return [relay.sent for relay in self.relays]

    def test_a_large_file_goes_on_at_the_other_server(self):
        photo = harness.large_png(width=3000, height=2400)  # 21 MB
        folder = self.photos()
        for name in os.listdir(folder):
            os.remove(os.path.join(folder, name))
        for name, data in (("a.png", photo), ("b.png", harness.large_png(1, 3000, 2400)),
                           ("c.png", harness.png())):
            with open(os.path.join(folder, name), "wb") as file:
                file.write(data)
        killed = threading.Event()

        def kill(server):
            if not killed.is_set():
                killed.set()
                server.kill()

        for server, relay in zip(self.servers, self.relays):
            relay.at(len(photo) - 1_000_000, lambda s=server: kill(s))
        job = self.ends(self.litags("submit", folder, "--iterations", "5")).strip()
        self.assertTrue(killed.is_set())
        survivor = next(i for i in (0, 1) if self.servers[i].process.poll() is None)
        # 20 MB of the first file were on their way to the other server, which had stored at least
        # one chunk of 8 MiB: that is not sent again.
        self.assertLess(self.relays[survivor].sent, 2 * len(photo) - (8 << 20) + 1_000_000)
        self.ends(self.litags("watch", job))
        self.assertEqual([f for f in self.servers[survivor].files("uploads")], [])
        self.assertFalse(any(files for _, _, files in
                             os.walk(os.path.join(self.folder, "blobs", "uploads"))))

    def test_a_watch_goes_on_at_the_other_server_and_pictures_come_from_there(self):
        job = self.ends(self.litags("submit", self.photos(), "--iterations", "150",
                                    "--preview-every", "10")).strip()
        before = self.sent()
        watch = self.litags("watch", job, "--json")
        number = self.in_use(before)
        time.sleep(1)
        self.servers[number].kill()
        events = [json.loads(line) for line in self.ends(watch).splitlines()]
        numbers = [int(event["number"]) for event in events if "number" in event]
        self.assertEqual(numbers, list(range(1, len(numbers) + 1)))
        picture = os.path.join(self.folder, "view.png")
        self.ends(self.litags("render", job, "--camera", "p1.png", "-o", picture))
        self.assertGreater(os.path.getsize(picture), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
