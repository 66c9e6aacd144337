"""A server that tests may kill: its processes, its data folder, and a client that never gives up."""

import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import tempfile
import time
import uuid

import grpc

import harness
from harness import job_pb2, rpc
from litags.v1 import model_service_pb2
from program_end import check_end, check_log

MARKER = "LITAGS_TEST_DEPLOYMENT"
# Generous, for machines that are busy with other things. Nothing waits this long when all is well:
# a job may not go on from a checkpoint for as long as the lease of a killed worker lasts, 10 s.
PATIENCE_S = 600
FINAL = (job_pb2.JOB_STATE_SUCCEEDED, job_pb2.JOB_STATE_FAILED, job_pb2.JOB_STATE_CANCELLED)
# What an idle data folder holds beside what belongs to jobs.
OWN_FILES = re.compile(r"litags\.db(-wal|-shm|-reserve)?|server\.lock|missed|blobs/installation/[0-9a-f]{32}")


class Process:
    """A program that tests start, kill and start again, with all that it starts itself."""

    def __init__(self, folder, command, environment=None, prefix=(), exit_code=0):
        """`exit_code`: of a program that SIGTERM ends."""
        self.folder = folder
        self.log_path = os.path.join(folder, "log")
        self.arguments = list(command)
        self.prefix = list(prefix)  # of the command: a wrapper that ends in exec
        self.marker = uuid.uuid4().hex
        self.environment = dict(os.environ, **(environment or {}), **{MARKER: self.marker})
        self.process = None
        self.exit_code = exit_code
        self.killed = False
        self.sessions = set()  # of each start; what it starts stays in them

    def command(self):
        return [*self.prefix, *self.arguments]

    def start(self):
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen(self.command(), env=self.environment, stdout=log,
                                            stderr=log, start_new_session=True)
        self.killed = False
        self.sessions.add(self.process.pid)
        return self

    def log(self):
        with open(self.log_path, errors="replace") as file:
            return file.read()

    def kill(self):
        """kill -9 of the program; raises if a sanitizer has reported."""
        self.killed = True
        self.process.kill()
        self.process.wait()
        check_log(self.log_path)

    def stop(self):
        """SIGTERM, unless it has ended; seconds until then. Raises if it has ended otherwise than by
        this or by kill(), or if a sanitizer has reported."""
        begin = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        try:
            code, seconds = self.process.wait(PATIENCE_S), time.monotonic() - begin
        finally:
            if self.process.poll() is None:
                self.process.kill()
                self.process.wait()
        check_end(code, self.log_path, -signal.SIGKILL if self.killed else self.exit_code)
        return seconds

    # What is running.

    def processes(self, words=""):
        """{pid: command line} of this deployment's living processes whose command has `words`."""
        found = {}
        for entry in os.listdir("/proc"):
            if not entry.isdigit():
                continue
            with contextlib.suppress(OSError):
                with open(f"/proc/{entry}/stat") as file:
                    state, _, _, session = file.read().rsplit(")", 1)[1].split()[:4]
                # Children of litags do not get the marker, PostgreSQL's leave the session.
                if int(session) not in self.sessions and not self._has_marker(entry):
                    continue
                with open(f"/proc/{entry}/cmdline", "rb") as file:
                    command = file.read().replace(b"\0", b" ").decode(errors="replace")
                if state != "Z" and words in command:
                    found[int(entry)] = command
        return found

    def _has_marker(self, pid):
        with contextlib.suppress(OSError), open(f"/proc/{pid}/environ", "rb") as file:
            return f"{MARKER}={self.marker}".encode() in file.read()
        return False

    def workers(self):
        return [pid for pid, command in self.processes("worker").items()
                if "--name" in command]

    def orphans(self):
        """What is still alive two seconds after the server has ended."""
        deadline = time.monotonic() + 2
        while self.processes() and time.monotonic() < deadline:
            time.sleep(0.02)
        return self.processes()


class Deployment(Process):
    """A server process on one port and one data folder, through deaths and restarts."""

    def __init__(self, folder, *flags, program=None, host="127.0.0.1", **more):
        super().__init__(folder, [], **more)
        self.data = os.path.join(folder, "data")
        self.program = program or harness.SERVER_PROGRAM
        self.flags = flags
        self.host = host
        self.port = 0

    def command(self):
        return [*self.prefix, os.path.join(harness.BIN, self.program), "--listen", self.address,
                "--data", self.data, "--port-file", self.port_file(), *self.flags]

    def port_file(self):
        return os.path.join(self.folder, "port")

    def start(self):
        with contextlib.suppress(FileNotFoundError):
            os.remove(self.port_file())
        super().start()
        self.port = harness.port_in(self.port_file(), self.process, self.log_path)
        return self

    @property
    def address(self):
        return f"{self.host}:{self.port}"

    # What is on disk.

    def files(self, below=""):
        """Relative paths of all files under data/`below`."""
        root = os.path.join(self.data, below)
        return sorted(os.path.relpath(os.path.join(folder, name), root)
                      for folder, _, names in os.walk(root) for name in names)

    def ask(self, statement, job):
        with contextlib.closing(sqlite3.connect(os.path.join(self.data, "litags.db"))) as store:
            return store.execute(statement, [job.removeprefix("jobs/")]).fetchall()

    def kept(self, job):
        """{name: path of the blob} of what the engine left of a job."""
        [(kept,)] = self.ask("SELECT kept FROM jobs WHERE id = ?", job)
        return {name: os.path.join(self.data, "blobs", job, file["blob"])
                for name, file in json.loads(kept or "{}").items()}

    def litter(self, job):
        """Blobs of a job that nothing names."""
        named = {os.path.relpath(path, os.path.join(self.data, "blobs", job))
                 for path in self.kept(job).values()}
        named |= {sha256 for sha256, in self.ask("SELECT sha256 FROM files WHERE job_id = ?", job)}
        named |= {json.loads(payload).get("preview") for payload, in
                  self.ask("SELECT payload FROM events WHERE job_id = ? AND kind = 2", job)}
        return sorted(set(self.files(f"blobs/{job}")) - named)

    def strays(self):
        """Files that belong to no job and no part of the service."""
        return [path for path in self.files() if not OWN_FILES.fullmatch(path)]

    def scene_digest(self, job):
        with open(self.kept(job)["scene.litags"], "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()


class Lost(Exception):
    """A promise was broken."""


class Client:
    """Does one job from creation to its end, over as many connections as that takes."""

    def __init__(self, address):
        # Knocks often: servers are away for a fraction of a second.
        self.channel = grpc.insecure_channel(address, options=[
            ("grpc.enable_http_proxy", 0), ("grpc.min_reconnect_backoff_ms", 50),
            ("grpc.initial_reconnect_backoff_ms", 50), ("grpc.max_reconnect_backoff_ms", 200)])
        self.jobs = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(self.channel)
        self.models = harness.model_service_pb2_grpc.ModelServiceStub(self.channel)

    def close(self):
        self.channel.close()

    @staticmethod
    def insist(call):
        """`call()` until the answer is not that the server is away."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                return call()
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.UNAVAILABLE:
                    raise
                if time.monotonic() > deadline:
                    raise Lost(f"the server stays away: {error.details()}") from error
                time.sleep(0.02)

    def get(self, job):
        return self.insist(lambda: self.jobs.GetJob(rpc.GetJobRequest(name=job), timeout=30))

    def create(self, **options):
        request = rpc.CreateJobRequest(request_id=uuid.uuid4().hex,
                                       options=job_pb2.JobOptions(**options))
        return self.insist(lambda: self.jobs.CreateJob(request, timeout=30)).name

    def upload(self, job, files):
        """`files`: (name, bytes, role) each."""
        def messages():
            yield rpc.UploadImagesRequest(name=job)
            for name, data, role in files:
                yield rpc.UploadImagesRequest(file=rpc.FileHeader(
                    file_name=name, role=role, size_bytes=len(data),
                    sha256=hashlib.sha256(data).digest()))
                for start in range(0, len(data), 16 << 10):
                    yield rpc.UploadImagesRequest(chunk=data[start:start + (16 << 10)])
            yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=len(files)))
        return self.insist(lambda: self.jobs.UploadImages(messages(), timeout=60))

    def start(self, job):
        try:
            self.insist(lambda: self.jobs.StartJob(rpc.StartJobRequest(name=job), timeout=30))
        except grpc.RpcError:
            # The answer to an earlier call may have been lost with its server.
            if self.get(job).state == job_pb2.JOB_STATE_UPLOADING:
                raise

    def resume(self, job, iterations):
        request = rpc.ResumeJobRequest(name=job, options=job_pb2.JobOptions(iterations=iterations))
        try:
            self.insist(lambda: self.jobs.ResumeJob(request, timeout=30))
        except grpc.RpcError:
            # As in start().
            if self.get(job).options.iterations != iterations:
                raise

    def watch(self, job, events=()):
        """Every event after those until the job's end, in the order they came."""
        events = list(events)
        self.follow(job, events)
        return events

    def follow(self, job, events, timeout=PATIENCE_S):
        """Adds the events up to the job's end, over as many streams as that takes."""
        def watch():
            after = events[-1].number if events else 0
            for event in self.jobs.WatchJob(rpc.WatchJobRequest(name=job, after_event=after),
                                            timeout=timeout):
                events.append(event)

        self.insist(watch)

    def model(self, job):
        """SHA-256 of the whole model."""
        def export():
            sha = hashlib.sha256()
            for part in self.models.ExportModel(model_service_pb2.ExportModelRequest(
                    name=job, format=model_service_pb2.MODEL_FORMAT_PLY_FULL), timeout=60):
                sha.update(part.chunk)
            return sha.hexdigest()
        return self.insist(export)

    def delete(self, job):
        try:
            self.insist(lambda: self.jobs.DeleteJob(rpc.DeleteJobRequest(name=job), timeout=30))
        except grpc.RpcError as error:
            if error.code() != grpc.StatusCode.NOT_FOUND:
                raise

    def run(self, files, in_two_parts=False, **options):
        """(job, events) of a job that is submitted and followed to its end. In two parts: it ends
        after the iterations of its schedule, and is then resumed for the others."""
        first = dict(options, iterations=options["schedule_iterations"],
                     schedule_iterations=0) if in_two_parts else options
        job = self.create(**first)
        self.upload(job, files)
        self.start(job)
        events = self.watch(job)
        if in_two_parts:
            self.resume(job, options["iterations"])
            events = self.watch(job, events)
        return job, events

    def started(self, files, **options):
        job = self.create(**options)
        self.upload(job, files)
        self.start(job)
        return job

    def wait_for(self, job, condition, what):
        deadline = time.monotonic() + PATIENCE_S
        while not condition(found := self.get(job)):
            if time.monotonic() > deadline:
                raise Lost(f"{job} never came to {what}: {found}")
            time.sleep(0.02)
        return found


def check_events(client, job, events):
    """The numbers are 1, 2, 3 ... to the job's last one."""
    numbers = [event.number for event in events]
    last = client.get(job).last_event
    if numbers != list(range(1, last + 1)):
        raise Lost(f"{job}: events {numbers} of 1..{last}")


def photos(count=3, slow=True, seed=0):
    """Small photos for the fake engine; a slow one makes an iteration last 20 ms."""
    names = ["slow.png" if slow else "a.png"] + [f"p{i}.png" for i in range(1, count)]
    return [(name, harness.png(seed=seed + i), rpc.FILE_ROLE_PHOTO)
            for i, name in enumerate(names)]


def capture(folder, views=12, size="160x120"):
    """The sample room's dark photos with their cameras, for the real engine."""
    subprocess.run([os.path.join(harness.BIN, "litags-sample"), folder, "--size", size, "--views",
                    str(views)], check=True, stdout=subprocess.DEVNULL)
    files = []
    low = os.path.join(folder, "low")
    for name in sorted(os.listdir(low)):
        with open(os.path.join(low, name), "rb") as file:
            files.append((name, file.read(), rpc.FILE_ROLE_PHOTO))
    with open(os.path.join(folder, "transforms_train.json"), "rb") as file:
        files.append(("transforms_train.json", file.read(), rpc.FILE_ROLE_CAMERAS))
    return files


@contextlib.contextmanager
def scratch():
    folder = tempfile.mkdtemp(prefix="litags-crash-")
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
