"""What the service tests share: a real server process, the real client program, gRPC stubs.

Run by CTest with LITAGS_BIN (folder of the programs), LITAGS_STUBS (folder of the generated Python
stubs) and LITAGS_SERVER_PROGRAM (name of the server's program) in the environment. Needs grpcio and
the standard library only.
"""

import contextlib
import hashlib
import os
import random
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import zlib

sys.path[:0] = [os.environ["LITAGS_STUBS"],
                os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support")]

import grpc  # noqa: E402
from litags.v1 import errors_pb2  # noqa: E402
from litags.v1 import job_pb2  # noqa: E402
from litags.v1 import model_service_pb2_grpc  # noqa: E402
from litags.v1 import reconstruction_service_pb2 as rpc  # noqa: E402
from litags.v1 import reconstruction_service_pb2_grpc  # noqa: E402
from litags.v1 import render_service_pb2_grpc  # noqa: E402
from program_end import check_end  # noqa: E402

BIN = os.environ["LITAGS_BIN"]
SERVER_PROGRAM = os.environ.get("LITAGS_SERVER_PROGRAM", "litags-server")
# Generous: a loaded machine must not fail a test. Nothing waits this long when all is well.
# Sanitized builds take several times as long.
SLOWER = int(os.environ.get("LITAGS_TEST_SLOWER", "1"))
PATIENCE_S = 60 * SLOWER


def png(width=64, height=48, seed=0):
    """A small RGB photo as PNG bytes, another one for every seed."""
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            rows += bytes(((x * 3 + seed * 17) % 256, (y * 5 + seed) % 256, (x ^ y) % 256))
    return png_of(width, height, zlib.compress(bytes(rows)))


def png_chunk(kind, data):
    body = kind + data
    return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))


def png_of(width, height, data, bits=8, colour=2):
    """A PNG, RGB by default, of compressed rows."""
    return (b"\x89PNG\r\n\x1a\n"
            + png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0))
            + png_chunk(b"IDAT", data) + png_chunk(b"IEND", b""))


def depth_png(width=64, height=48):
    """A depth map as a 16-bit grey PNG."""
    rows = b"".join(b"\0" + struct.pack(">%dH" % width, *range(1000, 1000 + width))
                    for _ in range(height))
    return png_of(width, height, zlib.compress(rows), bits=16, colour=0)


def mask_png(width=64, height=48):
    """A mask as an 8-bit grey PNG: the left half is not of the scene."""
    row = b"\0" + bytes(width // 2) + b"\xff" * (width - width // 2)
    return png_of(width, height, zlib.compress(row * height), colour=0)


def large_png(seed=0, width=1200, height=900):
    """A photo, of about 3 MB by default, that no compression makes smaller. It has nothing in
    common with that of another seed."""
    noise = random.Random(seed)
    rows = b"".join(b"\0" + noise.randbytes(3 * width) for _ in range(height))
    return png_of(width, height, zlib.compress(rows, 0))


def jpeg_header(width=64, height=48):
    """The start of a grey baseline JPEG, up to and including its first entropy-coded bytes."""
    dqt = b"\xff\xdb\x00\x43\x00" + bytes([16] * 64)
    sof = b"\xff\xc0\x00\x0b\x08" + struct.pack(">HH", height, width) + b"\x01\x01\x11\x00"
    counts = bytes([0, 2] + [0] * 14)  # two codes of two bits
    dht_dc = b"\xff\xc4\x00\x15\x00" + counts + b"\x00\x01"
    dht_ac = b"\xff\xc4\x00\x15\x10" + counts + b"\x00\x01"
    sos = b"\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00"
    return b"\xff\xd8" + dqt + sof + dht_dc + dht_ac + sos


def png_size(data):
    """Width and height of a PNG."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n", data[:8]
    return struct.unpack(">II", data[16:24])


def error_detail(error):
    """The ErrorDetail of a grpc.RpcError."""
    for key, value in error.trailing_metadata() or ():
        if key == "grpc-status-details-bin":
            status = errors_pb2.RpcStatus.FromString(value)
            for packed in status.details:
                detail = errors_pb2.ErrorDetail()
                if packed.Unpack(detail):
                    return detail
    return errors_pb2.ErrorDetail()


def memory_mib(pid, key):
    """VmRSS (now), VmHWM (the highest) or another line of /proc/PID/status."""
    with open(f"/proc/{pid}/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith(key)) >> 10


def quantile(values, share):
    """The value that this share of the others lie below."""
    return sorted(values)[int(share * (len(values) - 1))]


def port_in(port_file, process, log_path):
    """The port that a server has written into the file; waits for it to start."""
    deadline = time.monotonic() + PATIENCE_S
    while not os.path.exists(port_file):
        if process.poll() is not None or time.monotonic() > deadline:
            with open(log_path, errors="replace") as log:
                raise RuntimeError(f"no server:\n{log.read()}")
        time.sleep(0.02)
    with open(port_file) as file:
        return int(file.read())


class Server:
    """A server process with its data in `folder`; port 0 until it has started."""

    def __init__(self, folder, port=0, extra=(), program=None):
        self.data = os.path.join(folder, "data")
        port_file = os.path.join(folder, "port")
        with contextlib.suppress(FileNotFoundError):
            os.remove(port_file)
        self.log_path = os.path.join(folder, "server.log")
        self.log = open(self.log_path, "ab")
        self.process = subprocess.Popen(
            [program or os.path.join(BIN, SERVER_PROGRAM), "--listen", f"127.0.0.1:{port}", "--data", self.data,
             "--port-file", port_file, "--threads", "1", *extra],
            stdout=self.log, stderr=self.log)
        self.port = port_in(port_file, self.process, self.log_path)
        self.address = f"127.0.0.1:{self.port}"

    # Both raise if it has ended otherwise, or if a sanitizer has reported. Once it has ended, they do
    # nothing.

    def kill(self):
        """kill -9."""
        self._end(signal.SIGKILL, -signal.SIGKILL)

    def stop(self, exit_code=0):
        """SIGTERM."""
        self._end(signal.SIGTERM, exit_code)

    def _end(self, signal_number, exit_code):
        if self.log.closed:
            return
        self.process.send_signal(signal_number)
        try:
            code = self.process.wait(PATIENCE_S)
        finally:
            if self.process.poll() is None:
                self.process.kill()
                self.process.wait()
            self.log.close()
        check_end(code, self.log_path, exit_code)


def closed(sockets):
    """How many of these the other end has closed; what it said before is read."""
    found = 0
    for connection in sockets:
        connection.settimeout(0.01)
        with contextlib.suppress(TimeoutError):
            with contextlib.suppress(ConnectionError):
                while connection.recv(65536):
                    pass
            found += 1
    return found


class CuttableProxy:
    """A TCP relay to a server, whose connections can be cut or fall silent."""

    def __init__(self, port, cut_every=0, progress=None, silent_after=0):
        """`cut_every`: bytes from clients after which all connections are cut; 0: never.
        `progress`: how many bytes the server has kept: a cut is put off until it has what has come,
        for what a server has not read is lost with the connection.
        `silent_after`: bytes from clients after which it falls silent; 0: never."""
        self.target = port
        self.cut_every = cut_every
        self.progress = progress or (lambda: 0)
        self.silent_after = silent_after
        self.before = (0, self.progress())  # bytes sent and kept at the last cut
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listener.getsockname()[1]
        self.lock = threading.Lock()
        self.sockets = []
        self.connections = 0
        self.sent = 0        # bytes from clients
        self.closed = 0      # connections that the server ended
        self.silent = False  # takes all bytes and passes none on
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            try:
                server = socket.create_connection(("127.0.0.1", self.target))
            except OSError:  # no server there: a connection that breaks at once
                client.close()
                continue
            with self.lock:
                self.connections += 1
                self.sockets += [client, server]
            threading.Thread(target=self._relay, args=(client, server, True), daemon=True).start()
            threading.Thread(target=self._relay, args=(server, client, False), daemon=True).start()

    def _relay(self, source, sink, from_client):
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                if self.silent:
                    continue
                sink.sendall(data)
                if from_client and self._count(len(data)):
                    self._wait_for_rest()
                    self.cut()
                    self.before = (self.sent, self.progress())
            if not from_client:
                self.closed += 1
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def _wait_for_rest(self):
        """Until all but a part of a file is kept, or nothing more for a second."""
        sent, kept = self.before
        most, last = 0, time.monotonic()
        while most < self.sent - sent - (320 << 10) and time.monotonic() < last + 1:
            time.sleep(0.05)
            now = self.progress() - kept
            if now > most:
                most, last = now, time.monotonic()

    def _count(self, size):
        with self.lock:
            before, self.sent = self.sent, self.sent + size
            if self.silent_after and self.sent > self.silent_after:
                self.silent = True
            return self.cut_every and before // self.cut_every != self.sent // self.cut_every

    def cut(self):
        """Ends every connection there is; new ones are taken."""
        with self.lock:
            sockets, self.sockets = self.sockets, []
        for end in sockets:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def close(self):
        self.listener.close()
        self.cut()


class ServiceTest(unittest.TestCase):
    """One server for all tests of a class; `self.folder` is fresh for every test."""

    @classmethod
    def setUpClass(cls):
        cls.class_folder = tempfile.mkdtemp(prefix="litags-service-")
        cls.addClassCleanup(shutil.rmtree, cls.class_folder, ignore_errors=True)
        cls.server = cls.make_server()
        cls.addClassCleanup(lambda: cls.server.stop())
        cls.channel = grpc.insecure_channel(cls.server.address,
                                            options=[("grpc.enable_http_proxy", 0)])
        cls.addClassCleanup(cls.channel.close)
        cls.jobs = reconstruction_service_pb2_grpc.ReconstructionServiceStub(cls.channel)
        cls.pictures = render_service_pb2_grpc.RenderServiceStub(cls.channel)
        cls.models = model_service_pb2_grpc.ModelServiceStub(cls.channel)

    @classmethod
    def make_server(cls):
        return Server(cls.class_folder)

    def setUp(self):
        self.folder = tempfile.mkdtemp(dir=self.class_folder)

    def new_proxy(self, **options):
        """A CuttableProxy of the server."""
        proxy = CuttableProxy(self.server.port, **options)
        self.addCleanup(proxy.close)
        return proxy

    # The client program.

    def start_litags(self, *args, server=None):
        environment = dict(os.environ, LITAGS_SERVER=server or self.server.address)
        return subprocess.Popen([os.path.join(BIN, "litags"), *args], env=environment,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def litags(self, *args, exit_code=0, server=None):
        """Runs the client; returns (stdout, stderr)."""
        process = self.start_litags(*args, server=server)
        try:
            out, err = process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
        self.assertEqual(process.returncode, exit_code, f"litags {' '.join(args)}\n{out}\n{err}")
        return out, err

    def photos(self, names=("a.png", "b.png", "c.png"), size=(64, 48)):
        """A folder of photos of these names."""
        folder = tempfile.mkdtemp(dir=self.folder)
        for seed, name in enumerate(names):
            with open(os.path.join(folder, name), "wb") as file:
                file.write(png(*size, seed=seed))
        return folder

    def submit(self, *args, names=("a.png", "b.png", "c.png")):
        """Submits photos of these names; returns the job's name."""
        out, _ = self.litags("submit", self.photos(names), *args)
        self.assertRegex(out, r"^jobs/\S+\n$")
        return out.strip()

    def finished_job(self):
        """A job that has succeeded; the same one for a whole class."""
        cls = type(self)
        if not hasattr(cls, "finished"):
            cls.finished = self.submit("--iterations", "40", "--preview-every", "10")
            self.litags("watch", cls.finished)
        return cls.finished

    # The service, from Python.

    def state(self, job):
        return self.jobs.GetJob(rpc.GetJobRequest(name=job)).state

    def wait_for(self, condition, what):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            self.assertLess(time.monotonic(), deadline, f"waited in vain for: {what}")
            time.sleep(0.02)

    def assert_refused(self, call, code, reason, field, words):
        """`call` fails with this code, detail, and these words in its message."""
        with self.assertRaises(grpc.RpcError) as caught:
            result = call()
            if hasattr(result, "__next__"):
                list(result)
        error = caught.exception
        detail = error_detail(error)
        self.assertEqual((error.code(), detail.reason, detail.field), (code, reason, field),
                         error.details())
        self.assertRegex(error.details(), words)

    @staticmethod
    def upload(job, files, chunk=None, end=True):
        """The messages of an upload of (name, bytes) pairs; `end`: with the last one."""
        yield rpc.UploadImagesRequest(name=job)
        for name, data in files:
            yield rpc.UploadImagesRequest(file=rpc.FileHeader(
                file_name=name, role=rpc.FILE_ROLE_PHOTO, size_bytes=len(data),
                sha256=hashlib.sha256(data).digest()))
            size = chunk or (256 << 10)
            for start in range(0, len(data), size):
                yield rpc.UploadImagesRequest(chunk=data[start:start + size])
        if end:
            yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=len(files)))


SUCCEEDED = job_pb2.JOB_STATE_SUCCEEDED
RUNNING = job_pb2.JOB_STATE_RUNNING
CANCELLED = job_pb2.JOB_STATE_CANCELLED
FAILED = job_pb2.JOB_STATE_FAILED
