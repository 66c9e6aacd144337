"""Workers that come and go, and what they have: a server without workers of its own keeps jobs in
its queue until one comes that fits."""

import os
import signal
import subprocess
import time
import unittest

import harness
from harness import BIN, RUNNING, SERVER_PROGRAM, SUCCEEDED, check_end, rpc
from operating_test import metrics_of

from litags.v1 import job_pb2

WORKER = os.path.join(BIN, SERVER_PROGRAM.replace("server", "worker"))
QUEUED = job_pb2.JOB_STATE_QUEUED


class WithoutWorkers(harness.ServiceTest):

    @classmethod
    def make_server(cls):
        return harness.Server(cls.class_folder,
                              extra=("--workers", "0", "--metrics-listen", "127.0.0.1:0"))

    def setUp(self):
        super().setUp()
        self.log_path = os.path.join(self.folder, "worker.log")

    def start_worker(self, *args, exit_code=0):
        with open(self.log_path, "ab") as log:
            worker = subprocess.Popen([WORKER, "--data", self.server.data, "--threads", "1", *args],
                                      stdout=log, stderr=log)
        self.addCleanup(self.end, worker, exit_code)
        return worker

    def end(self, worker, exit_code=0):
        """SIGTERM, unless it has ended; seconds until then. Raises if it has ended otherwise, or if a
        sanitizer has reported."""
        start = time.monotonic()
        worker.send_signal(signal.SIGTERM)
        try:
            code, seconds = worker.wait(harness.PATIENCE_S), time.monotonic() - start
        finally:
            worker.kill()
        check_end(code, self.log_path, exit_code)
        return seconds

    def job(self, name):
        return self.jobs.GetJob(rpc.GetJobRequest(name=name))

    def metric(self, key):
        return metrics_of(self.server).get(key, 0)


class Fleet(WithoutWorkers):

    def test_jobs_wait_while_there_are_no_workers_and_run_when_one_comes(self):
        job = self.submit("--iterations", "20")
        self.assertEqual(self.job(job).state, QUEUED)
        self.assertIn("none is there", self.job(job).waits_for)
        self.assertEqual(self.metric("litags_workers"), 0)
        self.assertEqual(self.metric('litags_jobs{state="QUEUED"}'), 1)
        worker = self.start_worker()
        self.wait_for(lambda: self.state(job) == SUCCEEDED, "the job is done")
        self.assertEqual(self.job(job).waits_for, "")
        self.assertEqual(self.metric("litags_workers"), 1)
        self.end(worker)
        self.assertEqual(self.metric("litags_workers"), 0)

    def test_a_drained_worker_gives_its_job_back_at_no_cost(self):
        job = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        worker = self.start_worker()
        self.wait_for(lambda: self.state(job) == RUNNING, "the job runs")
        self.assertLess(self.end(worker), 10 * harness.SLOWER, "the grace of deploy/ is built on this")
        self.assertEqual(self.job(job).state, QUEUED)
        self.start_worker()
        self.wait_for(lambda: self.state(job) == RUNNING, "the job runs again")
        self.assertEqual(self.job(job).attempt, 1)
        self.litags("cancel", job)

    def test_a_job_goes_to_a_worker_that_has_what_it_needs(self):
        job = self.submit("--iterations", "20", "--min-cores", "3", "--min-memory", "1GiB",
                          "--worker-labels", "site-b,avx512")
        self.start_worker("--cores", "8", "--memory", "8GiB", "--labels", "avx512")
        self.wait_for(lambda: self.metric("litags_workers") == 1, "the first worker is there")
        easy = self.submit("--iterations", "20")
        self.wait_for(lambda: self.state(easy) == SUCCEEDED, "the worker works")
        waiting = self.job(job)
        self.assertEqual(waiting.state, QUEUED)
        self.assertIn("label site-b", waiting.waits_for)
        self.assertIn("site-b", self.litags("show", job)[0])
        self.assertEqual(self.metric("litags_jobs_without_fitting_worker"), 1)
        self.start_worker("--cores", "3", "--memory", "1GiB", "--labels", "site-b,avx512,more")
        self.wait_for(lambda: self.state(job) == SUCCEEDED, "the second worker takes it")
        self.assertEqual(self.metric("litags_jobs_without_fitting_worker"), 0)
        policy = self.job(job).policy
        self.assertEqual((policy.min_cores, policy.min_memory_bytes, list(policy.worker_labels)),
                         (3, 1 << 30, ["site-b", "avx512"]))

    def test_who_submits_or_watches_hears_what_the_job_waits_for(self):
        self.start_worker("--labels", "site-b")
        self.wait_for(lambda: self.metric("litags_workers") == 1, "the worker is there")
        out, err = self.litags("submit", self.photos(), "--worker-labels", "site-c")
        self.assertRegex(err, "waits for .*label site-c")
        job = out.strip()
        watch = self.start_litags("watch", job)
        watch.stdout.readline()  # the first event comes after it
        self.litags("cancel", job)
        self.assertRegex(watch.communicate(timeout=harness.PATIENCE_S)[1], "waits for .*label site-c")

    def test_a_job_that_waits_for_a_label_nobody_has_is_given_another_or_none(self):
        self.start_worker("--labels", "site-b")
        job = self.litags("submit", self.photos(), "--worker-labels", "site-c")[0].strip()
        self.litags("update", job, "--worker-labels", "site-d,site-e")
        self.assertEqual(list(self.job(job).policy.worker_labels), ["site-d", "site-e"])
        self.assertEqual(self.state(job), QUEUED)
        self.litags("update", job, "--worker-labels", "")
        self.wait_for(lambda: self.state(job) == SUCCEEDED, "any worker takes it")
        self.assertEqual(list(self.job(job).policy.worker_labels), [])

    def test_labels_that_are_none_are_refused(self):
        _, err = self.litags("submit", self.photos(), "--worker-labels", "a b", exit_code=2)
        self.assertRegex(err, "policy.worker_labels")
        worker = self.start_worker("--labels", "a b", exit_code=2)
        self.assertEqual(worker.wait(harness.PATIENCE_S), 2)


class LostWorker(WithoutWorkers):

    def test_a_job_of_the_only_worker_which_was_killed_is_cancelled_and_deleted(self):
        job = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        worker = self.start_worker(exit_code=-signal.SIGKILL)
        self.wait_for(lambda: self.state(job) == RUNNING, "the job runs")
        worker.kill()
        self.litags("cancel", job)
        self.wait_for(lambda: self.state(job) == harness.CANCELLED, "the server took the job back")
        self.litags("delete", job)


if __name__ == "__main__":
    unittest.main()
