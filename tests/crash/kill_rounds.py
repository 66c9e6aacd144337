"""kill -9 of whatever runs, at random moments, while jobs go from their upload to their end.

One round: a fresh server, some jobs from concurrent clients, two kills whose victims and moments
follow from the round's seed (as many rounds as there are victims kill each of them); then deletion, once in a while with a kill in the middle of it, and
the server's end. Some rounds' jobs are in two parts: they end, and are resumed for more
iterations. Against an undisturbed run of the same jobs, a round checks that every job ended
well, that its scene has the same bytes, that its events are numbered without gap or repeat, and
that no process and no file is left.
"""

import collections
import dataclasses
import os
import random
import signal
import threading
import time

import deployment
from deployment import Client, Deployment, Lost
from harness import job_pb2

KILLS = 2  # a job that loses its worker three times fails, by design
EARLY_KILLS = 0.25   # share of kills that fall into the first half second, when photos come in
TWO_PARTS = 0.33     # share of rounds whose jobs end early, and are then trained further
DELETE_KILLS = 0.5   # share of rounds with a kill of the server in the middle of the deletions
# What a kill leaves, of a job that was being deleted or of a file that was being written, the
# server removes once it has been quiet for as long as abandoned uploads are kept: here, a second.
SWEEP = ("--keep-uploads", "1")


@dataclasses.dataclass
class Workload:
    """Jobs that a round runs, and what may be killed meanwhile."""
    name: str
    program: str        # the server's
    files: list
    options: dict
    jobs: int
    victims: tuple
    flags: tuple = ("--workers", "2", "--threads", "1", "--sweep-every", "0.5")


@dataclasses.dataclass
class Undisturbed:
    seconds: float
    scene: str      # SHA-256
    files: list     # that the engine left


@dataclasses.dataclass
class Tally:
    rounds: int = 0
    jobs: int = 0
    kills: collections.Counter = dataclasses.field(default_factory=collections.Counter)
    lost_jobs: int = 0
    changed_scenes: int = 0
    broken_histories: int = 0
    orphans: int = 0
    swept: int = 0          # rounds in which a kill left something for the server to tidy up
    strays: int = 0
    complaints: list = dataclasses.field(default_factory=list)

    def complain(self, kind, seed, text):
        setattr(self, kind, getattr(self, kind) + 1)
        self.complaints.append(f"seed {seed}: {kind}: {text}")


def undisturbed(workload):
    """One job of the workload on a quiet server."""
    with deployment.scratch() as folder:
        server = Deployment(folder, *workload.flags, program=workload.program).start()
        client = Client(server.address)
        try:
            begin = time.monotonic()
            job, events = client.run(workload.files, **workload.options)
            seconds = time.monotonic() - begin
            state = client.get(job)
            if state.state != job_pb2.JOB_STATE_SUCCEEDED:
                raise Lost(f"even undisturbed {job} ends as {state}")
            deployment.check_events(client, job, events)
            return Undisturbed(seconds, server.scene_digest(job),
                               sorted(server.kept(job)))
        finally:
            client.close()
            server.stop()


class Round:
    """One seed of a workload; adds to `tally`, under `lock`."""

    def __init__(self, workload, reference, seed, tally, lock):
        self.workload, self.reference, self.seed = workload, reference, seed
        self.tally, self.lock = tally, lock
        self.random = random.Random(f"{workload.name}-{seed}")
        self.in_two_parts = self.random.random() < TWO_PARTS
        self.jobs = []  # (job, events) of those that came to an end

    def complain(self, kind, text):
        with self.lock:
            self.tally.complain(kind, self.seed, text)

    def run(self):
        with deployment.scratch() as folder:
            self.server = Deployment(folder, *self.workload.flags, program=self.workload.program)
            self.server.start()
            try:
                self.disturb()
                self.check()
                self.delete()
                self.sweep()
            finally:
                try:
                    self.server.stop()
                except AssertionError as error:
                    self.complain("orphans", f"the server {error}")
            if left := self.server.orphans():
                self.complain("orphans", f"left running: {left}")
            if strays := self.server.strays():
                self.complain("strays", f"left on disk: {strays}")
        with self.lock:
            self.tally.rounds += 1

    def one_job(self):
        client = Client(self.server.address)
        try:
            self.jobs.append(client.run(self.workload.files, self.in_two_parts,
                                        **self.workload.options))
        except Exception as error:  # whatever it is, the job is lost to its owner
            self.complain("lost_jobs", repr(error))
        finally:
            client.close()
            with self.lock:
                self.tally.jobs += 1

    def disturb(self):
        threads = [threading.Thread(target=self.one_job) for _ in range(self.workload.jobs)]
        begin = time.monotonic()
        for thread in threads:
            thread.start()
        span = self.reference.seconds * max(1, self.workload.jobs / 2)
        # Each victim has its turn in consecutive seeds, at a time when there is one: COLMAP runs first.
        sure = self.workload.victims[self.seed % len(self.workload.victims)]
        kills = [(self.random.uniform(0, 0.5 if sure == "colmap" else span / 2), sure)]
        while len(kills) < KILLS:
            within = 0.5 if self.random.random() < EARLY_KILLS else span
            kills.append((self.random.uniform(0, within),
                          self.random.choice(self.workload.victims)))
        for moment, victim in sorted(kills):
            time.sleep(max(0, begin + moment - time.monotonic()))
            self.strike(victim, threads)
        for thread in threads:
            thread.join()

    def strike(self, victim, threads):
        """Kills the victim, once there is one, while there are jobs."""
        while any(thread.is_alive() for thread in threads):
            if victim == "server":
                self.server.kill()
                self.server.start()
            else:
                found = self.server.workers() if victim == "worker" else \
                    list(self.server.processes("colmap "))
                found = [pid for pid in found if victim == "worker" or pid not in
                         [self.server.process.pid, *self.server.workers()]]
                if not found:
                    time.sleep(0.005)
                    continue
                try:
                    os.kill(self.random.choice(found), signal.SIGKILL)
                except ProcessLookupError:
                    continue  # it ended by itself just now
            with self.lock:
                self.tally.kills[victim] += 1
            return

    def check(self):
        client = Client(self.server.address)
        for job, events in self.jobs:
            state = client.get(job)
            if state.state != job_pb2.JOB_STATE_SUCCEEDED:
                self.complain("lost_jobs", f"{job} ended as {state}")
                continue
            try:
                deployment.check_events(client, job, events)
            except Lost as lost:
                self.complain("broken_histories", str(lost))
            if (digest := self.server.scene_digest(job)) != self.reference.scene:
                self.complain("changed_scenes", f"{job}: {digest} is not {self.reference.scene}")
            files = sorted(self.server.kept(job))
            if files != self.reference.files:
                self.complain("strays", f"{job} keeps {sorted(set(files) ^ set(self.reference.files))}"
                                        " more or less than undisturbed")
            if not self.comes_true(lambda: not self.server.litter(job)):
                self.complain("strays", f"nothing names {self.server.litter(job)} of {job}")
        client.close()

    @staticmethod
    def comes_true(condition):
        deadline = time.monotonic() + 30
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.05)
        return condition()

    def delete(self):
        client = Client(self.server.address)
        killer = None
        if self.random.random() < DELETE_KILLS:
            delay = self.random.uniform(0, 0.05)
            killer = threading.Thread(target=lambda: (time.sleep(delay), self.server.kill(),
                                                      self.server.start()))
            killer.start()
        for job, _ in self.jobs:
            client.delete(job)
        if killer:
            killer.join()
            with self.lock:
                self.tally.kills["server, deleting"] += 1
        client.close()

    def sweep(self):
        """Lets the server tidy up what deaths in the middle of something left behind."""
        if not self.server.strays():
            return
        with self.lock:
            self.tally.swept += 1
        self.server.stop()
        self.server.flags += SWEEP
        self.server.start()
        self.comes_true(lambda: not self.server.strays())


def run_rounds(workload, seeds, at_once=1, report=print):
    """A Tally of one round per seed, `at_once` of them at a time: most wait for leases to end."""
    reference = undisturbed(workload)
    report(f"{workload.name}: undisturbed in {reference.seconds:.1f} s")
    tally, lock = Tally(), threading.Lock()
    waiting = collections.deque(seeds)

    def work():
        while True:
            with lock:
                if not waiting:
                    return
                seed = waiting.popleft()
            begin = time.monotonic()
            try:
                Round(workload, reference, seed, tally, lock).run()
            except Exception as error:
                with lock:
                    tally.complain("lost_jobs", seed, repr(error))
            report(f"{workload.name}: seed {seed} took {time.monotonic() - begin:.1f} s")

    threads = [threading.Thread(target=work) for _ in range(at_once)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return tally


def fake_workload():
    """The fake engine: 3 jobs of 100 iterations of 20 ms each."""
    return Workload("fake engine", "litags-fake-server", deployment.photos(),
                    dict(iterations=100, schedule_iterations=60, checkpoint_every=7,
                         preview_every=10, seed=3), 3, ("server", "worker"))


def real_workload(folder):
    """The real engine and COLMAP on a tiny capture with known cameras."""
    return Workload("real engine", "litags-server", deployment.capture(folder),
                    dict(iterations=400, schedule_iterations=250, checkpoint_every=20,
                         preview_every=100, seed=3, threads=1), 1,
                    ("server", "worker", "colmap"),
                    ("--workers", "1", "--threads", "1", "--sweep-every", "0.5"))
