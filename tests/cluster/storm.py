"""Jobs on a cluster while its parts are killed and cut off at random.

Clients submit small jobs through random servers. Meanwhile servers, workers, PostgreSQL and the S3
server are killed (and started again), and nodes are cut off from the network, one after the other
and sometimes two at once, as a seed says. Then all is left alone, and every job must have ended
once and well, its model must have the bytes of an undisturbed run, its events must be numbered
without gap or repeat and be the same for all who ask, and no process, file or blob may be left that
nothing names; after all jobs are deleted, none at all.
"""

import collections
import dataclasses
import queue
import random
import threading
import time

import cluster as cluster_module
import deployment
import grpc
from deployment import Client, Lost
from harness import job_pb2, rpc

# Seconds until the next disturbance, that a killed node stays down, that a cut lasts.
PAUSE, DOWN, CUT = (0.3, 3), (0, 4), (1, 12)
VICTIMS = ("server",) * 3 + ("worker",) * 4 + ("postgres", "s3")
# Comes first, in some order, so that each storm has it.
SURE = (("kills", "server"), ("kills", "worker"), ("cuts", "server"), ("cuts", "worker"))
AWAY = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.CANCELLED,
        grpc.StatusCode.ABORTED, grpc.StatusCode.INTERNAL)
SECONDS = 10  # a call may take, until another server is asked


@dataclasses.dataclass
class Workload:
    engine: str
    files: list
    options: dict
    variants: int      # of the seed
    at_once: int       # clients


@dataclasses.dataclass
class Tally:
    jobs: int = 0
    resumed: int = 0     # of them: given up after three lost workers, and resumed by their owner
    attempts: int = 0    # leases of all jobs
    disturbances: collections.Counter = dataclasses.field(default_factory=collections.Counter)
    complaints: list = dataclasses.field(default_factory=list)

    def row(self):
        return (f"{self.jobs} | {', '.join(f'{n} {what}' for what, n in sorted(self.disturbances.items()))}"
                f" | {self.attempts} | {self.resumed} | {len(self.complaints)}")


class RovingClient(Client):
    """Asks another server whenever one does not answer."""

    def __init__(self, addresses, seed):
        self.random = random.Random(seed)
        self.peers = [Client(address) for address in addresses]
        self.rove()

    def rove(self):
        peer = self.random.choice(self.peers)
        self.jobs, self.models = peer.jobs, peer.models

    def close(self):
        for peer in self.peers:
            peer.close()

    def insist(self, call):
        deadline = time.monotonic() + deployment.PATIENCE_S
        while True:
            self.rove()
            try:
                return call()
            except grpc.RpcError as error:
                if error.code() not in AWAY:
                    raise
                if time.monotonic() > deadline:
                    raise Lost(f"the servers stay away: {error.details()}") from error
                time.sleep(0.1)


class Storm:

    def __init__(self, cluster, workload, seed, report):
        self.cluster, self.workload, self.report = cluster, workload, report
        self.random = random.Random(f"{workload.engine}-{seed}")
        self.tally = Tally()
        self.lock = threading.Lock()
        self.expected = {}  # digest of the model, by the options' seed
        self.done = []      # (job, seed, events)
        self.over = threading.Event()

    def complain(self, text):
        with self.lock:
            self.tally.complaints.append(text)
        self.report(text)

    def client(self, seed):
        return RovingClient(self.cluster.addresses(), seed)

    def undisturbed(self):
        client = self.client(0)
        for seed in range(self.workload.variants):
            job, _ = client.run(self.workload.files, seed=seed, **self.workload.options)
            self.expected[seed] = client.model(job)
            client.delete(job)
        client.close()

    # A job from its creation to its end.

    def one_job(self, client, seed):
        with self.lock:
            self.tally.jobs += 1
        job = client.started(self.workload.files, seed=seed, **self.workload.options)
        events = []
        while True:
            client.follow(job, events, timeout=SECONDS)
            found = client.get(job)
            if found.state == job_pb2.JOB_STATE_FAILED and \
                    found.error.detail.reason == "WORKER_LOST":
                with self.lock:
                    self.tally.resumed += 1
                self.resume(client, job)
                continue
            return job, seed, events

    @staticmethod
    def resume(client, job):
        try:
            client.insist(lambda: client.jobs.ResumeJob(rpc.ResumeJobRequest(name=job),
                                                        timeout=SECONDS))
        except grpc.RpcError:
            # The answer to an earlier call may have been lost.
            if client.get(job).state == job_pb2.JOB_STATE_FAILED:
                raise

    def work(self, number, waiting):
        client = self.client(f"{self.random.random()}-{number}")
        while True:
            try:
                seed = waiting.get_nowait()
            except queue.Empty:
                break
            try:
                done = self.one_job(client, seed)
                with self.lock:
                    self.done.append(done)
            except Exception as error:  # whatever it is, the job is lost to its owner
                self.complain(f"a job is lost: {error!r}")
        client.close()

    # What happens meanwhile.

    def rage(self):
        cuts = []  # (end, node)
        sure = self.random.sample(SURE, len(SURE))
        while not self.over.wait(self.random.uniform(*PAUSE)):
            now = time.monotonic()
            for cut in [cut for cut in cuts if cut[0] <= now]:
                self.cluster.heal(cut[1])
                cuts.remove(cut)
            what, kind = sure.pop() if sure else (self.random.choice(("kills", "cuts")),
                                                  self.random.choice(VICTIMS))
            node = self.random.choice([name for name in self.cluster.nodes
                                       if name.startswith(kind)])
            if what == "kills":
                self.cluster.kill(node, self.random.uniform(*DOWN))
            elif node not in [name for _, name in cuts]:
                self.cluster.cut(node)
                cuts.append((now + self.random.uniform(*CUT), node))
            else:
                continue
            self.tally.disturbances[f"{what} of {kind}"] += 1
        for _, node in cuts:
            self.cluster.heal(node)

    # Afterwards.

    def check_job(self, client, job, seed, events):
        found = client.get(job)
        self.tally.attempts += sum(e.state_change.state == job_pb2.JOB_STATE_RUNNING
                                   for e in events if e.HasField("state_change"))
        if found.state != job_pb2.JOB_STATE_SUCCEEDED:
            return self.complain(f"{job} ended as {found}")
        if [e.number for e in events] != list(range(1, found.last_event + 1)):
            self.complain(f"{job}: events {[e.number for e in events]} of {found.last_event}")
        again = []
        client.follow(job, again, timeout=SECONDS)
        if again != events:
            self.complain(f"{job}: events change when they are read again")
        ends = [e for e in events if e.HasField("state_change")
                and e.state_change.state == job_pb2.JOB_STATE_SUCCEEDED]
        if len(ends) != 1:
            self.complain(f"{job} ended {len(ends)} times")
        if client.model(job) != self.expected[seed]:
            self.complain(f"{job}: another model than undisturbed")

    def settles(self, what, condition, seconds=180):
        deadline = time.monotonic() + seconds
        while (left := condition()) and time.monotonic() < deadline:
            time.sleep(0.5)
        if left:
            self.complain(f"{what}: {left if len(left) < 9 else len(left)}")

    def check(self):
        client = self.client(1)
        for job, seed, events in self.done:
            self.check_job(client, job, seed, events)
        self.settles("blobs that nothing names",
                     lambda: sorted(set(self.cluster.keys()) - self.cluster.named()))
        missing = sorted(self.cluster.named() - set(self.cluster.keys()))
        if missing:
            self.complain(f"named, but not there: {missing}")
        for job, _, _ in self.done:
            client.delete(job)
        client.close()
        self.settles("blobs of deleted jobs", self.cluster.keys)
        self.settles("files in data folders", self.cluster.stray_files)
        if left := self.cluster.stop():
            self.complain(f"processes are left of {left}")

    def run(self, jobs, seconds):
        """`jobs` in all, and disturbances for that long, or until the last job has ended."""
        self.undisturbed()
        waiting = queue.Queue()
        for i in range(jobs):
            waiting.put(i % self.workload.variants)
        clients = [threading.Thread(target=self.work, args=(i, waiting))
                   for i in range(self.workload.at_once)]
        storm = threading.Thread(target=self.rage)
        begin = time.monotonic()
        for thread in [*clients, storm]:
            thread.start()
        while any(c.is_alive() for c in clients) and time.monotonic() < begin + seconds:
            time.sleep(0.1)
        self.over.set()
        storm.join()
        calm = time.monotonic()
        for thread in clients:
            thread.join()
        self.report(f"{self.workload.engine}: stormy for {calm - begin:.0f} s, "
                    f"all jobs ended {time.monotonic() - calm:.0f} s later")
        self.check()
        return self.tally


def fake_workload(iterations=100):
    """The fake engine: iterations of 20 ms each."""
    return Workload("fake", deployment.photos(),
                    dict(iterations=iterations, checkpoint_every=7, preview_every=10), 4, 6)


def real_workload(folder):
    """The real engine and COLMAP on a tiny capture with known cameras."""
    return Workload("real", deployment.capture(folder),
                    dict(iterations=300, checkpoint_every=20, preview_every=100, threads=1), 1, 2)


def run(workload, seed, jobs, seconds, report):
    with cluster_module.running(workload.engine) as cluster:
        report(f"{workload.engine}: seed {seed}, network: {type(cluster.net).__name__}")
        return Storm(cluster, workload, seed, report).run(jobs, seconds)
