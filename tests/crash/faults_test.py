"""Faults of the machine and of neighbours: each ends in the outcome that docs/reliability.md names."""

import contextlib
import os
import random
import stat
import subprocess
import time
import unittest
import uuid

import grpc

import deployment
import harness
import skipping
from deployment import Client, Deployment
from harness import job_pb2, rpc
from operating_test import NOT_SERVING, SERVING, health_of, metrics_of

FAILED = job_pb2.JOB_STATE_FAILED
RUNNING = job_pb2.JOB_STATE_RUNNING
SUCCEEDED = job_pb2.JOB_STATE_SUCCEEDED
FAKE = "litags-fake-server"
REAL = "litags-server"


def may_mount():
    """Whether a mount namespace of our own can be had, as root or by way of a user namespace."""
    return subprocess.run([*OWN_MOUNTS, "true"], capture_output=True).returncode == 0


# A command's own mounts, which vanish with it.
OWN_MOUNTS = (["unshare", "--mount"] if os.geteuid() == 0 else
              ["unshare", "--user", "--map-current-user", "--keep-caps", "--mount"])

limits_memory = unittest.skipIf(harness.SLOWER > 1, "a sanitizer needs more address space")


class FaultTest(unittest.TestCase):

    def setUp(self):
        self.stack = contextlib.ExitStack()
        self.addCleanup(self.stack.close)
        self.folder = self.stack.enter_context(deployment.scratch())

    def deploy(self, *flags, program=FAKE, **more):
        flags = ("--threads", "1", *flags)
        server = Deployment(self.folder, *flags, program=program, **more).start()
        self.addCleanup(self.end, server)
        return server

    def end(self, server):
        server.stop()
        self.assertEqual(server.orphans(), {})

    def client(self, server):
        client = Client(server.address)
        self.addCleanup(client.close)
        return client

    def refused(self, call, code):
        """The reason and message of the refusal."""
        with self.assertRaises(grpc.RpcError) as caught:
            call()
        self.assertEqual(caught.exception.code(), code, caught.exception.details())
        return harness.error_detail(caught.exception).reason, caught.exception.details()

    def capture(self, **more):
        return deployment.capture(os.path.join(self.folder, "capture"), **more)

    def script(self, name, text):
        path = os.path.join(self.folder, name)
        with open(path, "w") as file:
            file.write("#!/bin/sh\n" + text)
        os.chmod(path, stat.S_IRWXU)
        return path


class Colmap(FaultTest):
    """Real server and worker; COLMAP is what the operator says it is."""

    def fails(self, *flags, **more):
        server = self.deploy(*flags, program=REAL, **more)
        client = self.client(server)
        job, events = client.run(self.capture(views=5, size="64x48"), iterations=10)
        deployment.check_events(client, job, events)
        found = client.get(job)
        self.assertEqual(found.state, FAILED, found)
        return server, found

    def seen_by_colmap(self, commands, words, **more):
        """The log of a server whose COLMAP runs these commands, and which of the words they say."""
        os.mkdir(os.path.join(self.folder, "bin"))  # it may read its own folder
        curious = self.script("bin/colmap", f"""
            if [ "$1" = help ]; then echo 'COLMAP 3.8 (a fake)'; exit; fi
            {{ {commands}; }} > "$TMPDIR/seen" 2>&1
            grep -aoE '{"|".join(words)}' "$TMPDIR/seen" | sort -u
            exit 1""")
        server, job = self.fails("--colmap", curious, **more)
        self.assertEqual(job.error.detail.reason, "COLMAP_FAILED", job.error)
        return server.log(), [word for word in words if word in job.error.message]

    def test_colmap_sees_no_secret_and_opens_no_socket(self):
        # A sanitizer must look into its own process, so others can, too.
        others = "cat /proc/[0-9]*/environ" if harness.SLOWER == 1 else "true"
        secret = uuid.uuid4().hex
        _, seen = self.seen_by_colmap(
            f"env; {others}; bash -c 'echo > /dev/udp/127.0.0.1/9' && echo was-sent",
            ["QT_QPA_PLATFORM=offscreen", secret, "was-sent"], environment={
                "AWS_SECRET_ACCESS_KEY": secret, "PGPASSWORD": secret, "MY_TOKEN": secret})
        self.assertEqual(seen, ["QT_QPA_PLATFORM=offscreen"])

    def test_colmap_reads_no_files_but_its_own(self):
        secret, own = uuid.uuid4().hex, uuid.uuid4().hex
        path = os.path.join(self.folder, "secret")
        with open(path, "w") as file:
            file.write(secret)
        log, seen = self.seen_by_colmap(
            f"cat {path}; head -c 15 {self.folder}/data/litags.db; ls {self.folder}/data; "
            f"echo {own} > $TMPDIR/own; cat $TMPDIR/own", [secret, "SQLite format", "uploads", own])
        if "(Landlock)" in log:
            self.skipTest("this kernel has no Landlock, as the server says")
        self.assertEqual(seen, [own])

    def test_missing_colmap_fails_the_job_and_says_how_to_get_it(self):
        _, job = self.fails("--colmap", "no-such-colmap")
        self.assertEqual(job.error.detail.reason, "COLMAP_NOT_FOUND")
        self.assertRegex(job.error.message, "apt-get install colmap")

    def test_hanging_colmap_is_ended_by_its_time_limit(self):
        hanging = self.script("colmap", "trap '' TERM\nsleep 1000 &\nwait\n")
        server, job = self.fails("--colmap", hanging, "--colmap-timeout", "1")
        self.assertEqual(job.error.detail.reason, "PROGRAM_TIMEOUT")
        self.assertEqual(server.processes("sleep"), {})

    def test_cancel_ends_a_hanging_colmap_and_leaves_no_process(self):
        hanging = self.script("colmap", "trap '' TERM\nsleep 1000 &\nwait\n")
        server = self.deploy("--colmap", hanging, program=REAL)
        client = self.client(server)
        job = client.started(self.capture(views=5, size="64x48"), iterations=10)
        client.wait_for(job, lambda j: j.state == FAILED or server.processes("sleep 1000"),
                        "the program that hangs")
        self.assertEqual(client.get(job).state, RUNNING)
        client.jobs.CancelJob(rpc.CancelJobRequest(name=job))
        client.wait_for(job, lambda j: j.state == job_pb2.JOB_STATE_CANCELLED, "its cancellation")
        self.assertEqual(server.processes("sleep"), {})
        client.delete(job)
        self.assertEqual([f for f in server.files() if job.removeprefix("jobs/") in f], [])


class Memory(FaultTest):

    @limits_memory
    def test_worker_out_of_memory_fails_the_job_and_the_next_one_works(self):
        server = self.deploy("--worker-memory", "1GiB")
        client = self.client(server)
        greedy = [(name, harness.png(seed=seed), rpc.FILE_ROLE_PHOTO)
                  for seed, name in enumerate(("memory.png", "b.png", "c.png"))]
        job, events = client.run(greedy, iterations=10)
        deployment.check_events(client, job, events)
        found = client.get(job)
        self.assertEqual((found.state, found.attempt), (FAILED, 3), found)
        self.assertEqual(found.error.detail.reason, "WORKER_LOST")
        self.assertRegex(found.error.message, "it ran out of memory.*max_image_side")
        modest, _ = client.run(deployment.photos(slow=False), iterations=5)
        self.assertEqual(client.get(modest).state, SUCCEEDED)


class Checkpoints(FaultTest):

    OPTIONS = dict(iterations=1500, checkpoint_every=50, preview_every=500, seed=3, threads=1)

    def interrupted(self):
        """(server, client, job): stopped by SIGTERM while it trained."""
        server = self.deploy(program=REAL)
        client = self.client(server)
        job = client.started(self.files, **self.OPTIONS)
        client.wait_for(job, lambda j: j.progress.iteration >= 10 or j.state == SUCCEEDED,
                        "iteration 10")
        self.assertEqual(client.get(job).state, RUNNING, "trained too fast to be interrupted")
        self.assertLess(server.stop(), 10, "seconds")
        self.assertEqual(server.orphans(), {})
        return server, client, job

    @classmethod
    def setUpClass(cls):
        """Makes the capture, and the scene that an undisturbed run makes of it."""
        folder = cls.enterClassContext(deployment.scratch())
        cls.files = deployment.capture(os.path.join(folder, "capture"))
        server = Deployment(folder, "--threads", "1", program=REAL).start()
        client = Client(server.address)
        try:
            job, _ = client.run(cls.files, **cls.OPTIONS)
            cls.undisturbed = server.scene_digest(job)
        finally:
            client.close()
            server.stop()

    def checkpoint(self, server, job):
        return server.kept(job)["checkpoint.litags"]

    def test_sigterm_keeps_the_work_done_and_the_job_goes_on_after_a_restart(self):
        server, client, job = self.interrupted()
        self.assertTrue(os.path.exists(self.checkpoint(server, job)))
        server.start()
        events = client.watch(job)
        found = client.get(job)
        self.assertEqual(found.state, SUCCEEDED, found)
        self.assertEqual(found.attempt, 1)  # a shutdown costs no attempt
        deployment.check_events(client, job, events)
        notes = list(found.report.notes)
        resumed = [int(n.split()[-1]) for n in notes if n.startswith("resumed at iteration ")]
        self.assertTrue(resumed and resumed[0] >= 10, notes)
        self.assertEqual(server.scene_digest(job), self.undisturbed)

    def test_damaged_checkpoint_is_told_and_training_starts_again(self):
        server, client, job = self.interrupted()
        path = self.checkpoint(server, job)
        with open(path, "r+b") as file:
            file.seek(os.path.getsize(path) // 2)
            byte = file.read(1)
            file.seek(-1, os.SEEK_CUR)
            file.write(bytes([byte[0] ^ 0x10]))
        server.start()
        client.watch(job)
        found = client.get(job)
        self.assertEqual(found.state, SUCCEEDED, found)
        self.assertTrue(any("checkpoint could not be used" in n for n in found.report.notes),
                        found.report.notes)
        self.assertEqual(server.scene_digest(job), self.undisturbed)


class Store(FaultTest):

    def test_second_server_on_one_data_folder_refuses(self):
        first = self.deploy()
        second = subprocess.run(first.command()[:2] + ["127.0.0.1:0", "--data", first.data],
                                capture_output=True, text=True, timeout=60)
        self.assertNotEqual(second.returncode, 0)
        self.assertRegex(second.stderr, "another litags-server uses .*--data")
        client = self.client(first)
        job, _ = client.run(deployment.photos(slow=False), iterations=5)
        self.assertEqual(client.get(job).state, SUCCEEDED)

    def test_sigterm_with_queued_jobs_ends_in_seconds_and_loses_none(self):
        server = self.deploy("--workers", "2")
        client = self.client(server)
        jobs = [client.started(deployment.photos(), iterations=100, checkpoint_every=5)
                for _ in range(4)]
        client.wait_for(jobs[0], lambda j: j.progress.iteration > 5, "iteration 5")
        self.assertLess(server.stop(), 10, "seconds")
        self.assertEqual(server.orphans(), {})
        server.start()
        for job in jobs:
            events = client.watch(job)
            deployment.check_events(client, job, events)
            self.assertEqual(client.get(job).state, SUCCEEDED)

    def test_damaged_database_is_refused_with_its_remedy(self):
        server = self.deploy()
        client = self.client(server)
        job, _ = client.run(deployment.photos(slow=False), iterations=50, preview_every=1)
        self.assertEqual(client.get(job).state, SUCCEEDED)
        server.stop()
        path = os.path.join(server.data, "litags.db")
        pages = os.path.getsize(path) // 4096
        self.assertGreater(pages, 8)
        with open(path, "r+b") as file:
            file.seek(4096 * (pages // 2))
            file.write(random.Random(1).randbytes(4096))
        again = subprocess.run(server.command(), capture_output=True, text=True, timeout=60)
        self.assertNotEqual(again.returncode, 0)
        self.assertRegex(again.stderr, r"litags\.db is damaged .*backup")

    def in_small_disk(self, megabytes):
        """A wrapper that gives the server's data folder a disk of its own of that size."""
        if not may_mount():
            self.skipTest("no mount namespace to be had: a small disk cannot be made")
        data = os.path.join(self.folder, "data")
        os.makedirs(data, exist_ok=True)
        return [*OWN_MOUNTS, "sh", "-c",
                f'mount -t tmpfs -o size={megabytes}m tmpfs "{data}" && exec "$@"', "sh"]

    def inside(self, server, command):
        """Runs a shell command among the server's mounts."""
        user = [] if os.geteuid() == 0 else ["--user", "--preserve-credentials"]
        subprocess.run(["nsenter", "--target", str(server.process.pid), "--mount", *user, "sh",
                        "-c", command], check=True)

    def fill_disk(self, server):
        self.inside(server, f'dd if=/dev/zero of="{server.data}/ballast" bs=4k 2>/dev/null || true')

    def make_room(self, server):
        self.inside(server, f'rm "{server.data}/ballast"')

    def test_a_small_disk_is_noted_and_keeps_no_server_from_its_start(self):
        colmap = self.script("colmap", "echo 'COLMAP 3.8 (a fake)'\n")
        server = Deployment(self.folder, "--check", "--colmap", colmap, program=FAKE,
                            prefix=self.in_small_disk(64))
        done = subprocess.run(server.command(), capture_output=True, text=True, timeout=60)
        self.assertRegex(done.stdout, r"(?m)^note +space +6\d MiB free ")
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_full_disk_refuses_cleanly_and_serves_again_once_there_is_room(self):
        server = self.deploy("--metrics-listen", "127.0.0.1:0", prefix=self.in_small_disk(64))
        client = self.client(server)
        done, _ = client.run(deployment.photos(slow=False), iterations=5)
        photo = [("big.png", harness.png(600, 500, seed=1), rpc.FILE_ROLE_PHOTO)]
        waiting = client.create()
        self.assertEqual(health_of(client.channel), SERVING)
        full = 'litags_store_errors_total{reason="DISK_FULL"}'
        before = metrics_of(server)[full]
        self.fill_disk(server)
        reason, message = self.refused(lambda: client.upload(waiting, photo),
                                       grpc.StatusCode.RESOURCE_EXHAUSTED)
        self.assertEqual(reason, "DISK_FULL")
        self.assertRegex(message, "free some space")
        self.assertGreater(metrics_of(server)[full], before)
        client.wait_for(done, lambda _: health_of(client.channel) == NOT_SERVING, "no health")
        # What needs no room still works.
        self.assertEqual(client.get(done).state, SUCCEEDED)
        list(client.jobs.WatchJob(rpc.WatchJobRequest(name=done)))
        self.make_room(server)
        client.wait_for(done, lambda _: health_of(client.channel) == SERVING, "health")
        client.upload(waiting, photo)
        self.assertEqual(client.get(waiting).photos, 1)
        again, events = client.run(deployment.photos(slow=False), iterations=5)
        deployment.check_events(client, again, events)
        self.assertEqual(client.get(again).state, SUCCEEDED)

    def job_on_full_disk(self, *flags):
        """(server, client, a job that runs and finds no room any more, its model undisturbed)."""
        server = self.deploy(*flags, prefix=self.in_small_disk(128))
        client = self.client(server)
        options = dict(iterations=100, checkpoint_every=5)
        undisturbed, _ = client.run(deployment.photos(), **options)
        model = client.model(undisturbed)
        job = client.started(deployment.photos(), **options)
        client.wait_for(job, lambda j: j.progress.iteration > 10, "iteration 10")
        self.fill_disk(server)
        return server, client, job, model

    def test_job_that_cannot_write_a_checkpoint_fails_and_can_be_resumed(self):
        store = f"sqlite://{self.folder}/jobs.db"  # on another disk: the failure can be noted
        server, client, job, model = self.job_on_full_disk("--store", store)
        found = client.wait_for(job, lambda j: j.state != RUNNING, "its end")
        self.assertEqual((found.state, found.error.detail.reason), (FAILED, "DISK_FULL"), found)
        self.make_room(server)
        client.jobs.ResumeJob(rpc.ResumeJobRequest(name=job))
        self.assert_ended_well(client, job, model)

    def test_job_whose_failure_cannot_be_noted_goes_on_once_there_is_room(self):
        server, client, job, model = self.job_on_full_disk()
        client.wait_for(job, lambda _: f"job={job.removeprefix('jobs/')} failed" in server.log(),
                        "a failure")
        self.assertEqual(client.get(job).state, RUNNING)
        self.make_room(server)
        self.assert_ended_well(client, job, model)
        self.assertEqual(client.get(job).attempt, 2)

    def assert_ended_well(self, client, job, model):
        deployment.check_events(client, job, client.watch(job))
        self.assertEqual(client.get(job).state, SUCCEEDED, client.get(job))
        self.assertEqual(client.model(job), model)

    def test_read_only_store_is_refused_with_its_remedy(self):
        if not may_mount():
            self.skipTest("no mount namespace to be had: a read-only folder cannot be made")
        server = self.deploy()
        server.stop()
        read_only = (f'mount --bind "{server.data}" "{server.data}" && '
                     f'mount -o remount,bind,ro "{server.data}" && exec "$@"')
        again = subprocess.run([*OWN_MOUNTS, "sh", "-c", read_only, "sh", *server.command()],
                               capture_output=True, text=True, timeout=60)
        self.assertNotEqual(again.returncode, 0)
        self.assertRegex(again.stderr, "cannot use .* as the data folder: Read-only file system; "
                                       "choose another")


class Hardening(FaultTest):

    @limits_memory
    def test_workers_run_with_nothing_they_do_not_need(self):
        server = self.deploy("--worker-memory", "2GiB")
        client = self.client(server)
        job = client.started(deployment.photos(), iterations=50)
        client.wait_for(job, lambda j: j.state == RUNNING, "its worker")
        [worker] = server.workers()
        with open(f"/proc/{worker}/status") as file:
            status = file.read()
        self.assertRegex(status, r"NoNewPrivs:\s1\n")
        if "not hardened as it should be: fewer system calls" not in server.log():
            self.assertRegex(status, r"Seccomp:\s2\n")
        with open(f"/proc/{worker}/limits") as file:
            limits = file.read()
        self.assertRegex(limits, r"Max core file size\s+0\s+0\s")
        self.assertRegex(limits, rf"Max address space\s+{2 << 30}\s+{2 << 30}\s")
        self.assertRegex(limits, rf"Max file size\s+{64 << 30}\s+{64 << 30}\s")
        client.watch(job)
        self.assertEqual(client.get(job).state, SUCCEEDED)

    def worker_of(self, server):
        client = self.client(server)
        job = client.started(deployment.photos(), iterations=1)
        client.watch(job)
        [worker] = server.workers()
        return worker

    @staticmethod
    def network_of(pid):
        return os.readlink(f"/proc/{pid}/ns/net")

    def test_workers_are_nicer_than_the_server_and_have_no_network(self):
        server = self.deploy()
        worker = self.worker_of(server)
        niceness = os.getpriority(os.PRIO_PROCESS, server.process.pid)
        self.assertEqual(os.getpriority(os.PRIO_PROCESS, worker), min(19, niceness + 5))
        if "not hardened as it should be" in server.log():
            self.skipTest("this machine allows no network namespace")
        self.assertNotEqual(self.network_of(worker), self.network_of("self"))

    def test_workers_keep_their_network_and_niceness_if_told_so(self):
        server = self.deploy("--worker-network", "--worker-niceness", "9")
        worker = self.worker_of(server)
        niceness = os.getpriority(os.PRIO_PROCESS, server.process.pid)
        self.assertEqual(os.getpriority(os.PRIO_PROCESS, worker), min(19, niceness + 9))
        self.assertEqual(self.network_of(worker), self.network_of("self"))


class Ends(FaultTest):
    """Of the programs of these tests."""

    def started(self, at_end, exit_code=0):
        program = deployment.Process(self.folder, [self.script("program", f"""
            trap 'echo "{at_end}"; exit {exit_code}' TERM
            echo ready
            while :; do sleep 0.02; done""")])
        open(program.log_path, "w").close()
        self.addCleanup(program.start().process.kill)
        deadline = time.monotonic() + deployment.PATIENCE_S
        while program.log() != "ready\n":
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        return program

    def test_a_program_that_ends_badly_or_reports_fails(self):
        self.started("stopped").stop()
        with self.assertRaisesRegex(AssertionError, "ended with 3, not 0"):
            self.started("stopped", 3).stop()
        killed = self.started("stopped")
        killed.kill()
        killed.stop()
        with self.assertRaisesRegex(AssertionError, "ThreadSanitizer: data race"):
            self.started("WARNING: ThreadSanitizer: data race", 66).stop()


if __name__ == "__main__":
    skipping.run_tests()
