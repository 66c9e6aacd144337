"""What operators see of a server: metrics as Prometheus reads them, health as probes ask for it."""

import os
import re
import shutil
import signal
import subprocess
import tempfile
import unittest
import urllib.request

import grpc

import harness
from harness import BIN, RUNNING, SERVER_PROGRAM

WORKER_PROGRAM = SERVER_PROGRAM.replace("server", "worker")
SERVING, NOT_SERVING = 1, 2  # HealthCheckResponse.ServingStatus of grpc.health.v1


def metrics_of(server):
    """{'name{label="value"}': number} of a scrape."""
    with open(server.log_path) as log:
        port = re.findall(r"metrics at port (\d+)", log.read())[-1]
    open_url = urllib.request.build_opener(urllib.request.ProxyHandler({})).open
    with open_url(f"http://127.0.0.1:{port}/metrics", timeout=harness.PATIENCE_S) as answer:
        lines = answer.read().decode().splitlines()
    return {key: float(value) for key, value in
            (line.rsplit(" ", 1) for line in lines if not line.startswith("#"))}


def health_of(channel, service=""):
    """One health check, its two messages by hand: both hold one field."""
    check = channel.unary_unary("/grpc.health.v1.Health/Check")
    name = service.encode()
    answer = check((b"\x0a" + bytes([len(name)]) + name) if name else b"",
                   timeout=harness.PATIENCE_S)
    return answer[1]


def services_of(channel):
    """The answer of server reflection that lists the services, as its bytes."""
    ask = channel.stream_stream("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo")
    list_services = b"\x3a\x00"
    return next(ask(iter([list_services]), timeout=harness.PATIENCE_S))


class Metrics(harness.ServiceTest):

    @classmethod
    def make_server(cls):
        return harness.Server(cls.class_folder, extra=("--metrics-listen", "127.0.0.1:0"))

    def metric(self, key):
        return metrics_of(self.server).get(key, 0)

    def test_what_clients_do_is_counted(self):
        before = metrics_of(self.server)
        photos = self.photos(size=(72, 56))  # no other test's, which need not be sent again
        size = sum(os.path.getsize(os.path.join(photos, name)) for name in os.listdir(photos))
        out, _ = self.litags("submit", photos, "--watch", "--iterations", "20")
        job = out.strip()
        for i in range(3):
            self.litags("render", job, "--camera", "a.png", "-o",
                        os.path.join(self.folder, f"view{i}.png"))
        self.litags("path", job, "--orbit", "--frames", "4", "-o",
                    os.path.join(self.folder, "path"))
        self.litags("show", "jobs/0123456789abcdef", exit_code=4)
        after = metrics_of(self.server)
        grown = {key: value - before.get(key, 0) for key, value in after.items()}
        self.assertEqual(grown['litags_jobs{state="SUCCEEDED"}'], 1)
        self.assertEqual(grown["litags_uploaded_bytes_total"], size)
        self.assertEqual(grown['litags_calls_total{code="OK",method="RenderView"}'], 3)
        self.assertEqual(grown['litags_calls_total{code="NOT_FOUND",method="GetJob"}'], 1)
        self.assertEqual(grown['litags_call_seconds_count{method="RenderView"}'], 3)
        self.assertEqual(grown['litags_call_seconds_bucket{method="RenderView",le="+Inf"}'], 3)
        self.assertEqual(grown["litags_picture_seconds_count"], 3 + 4)
        for reason in ('STORE_FAILED', 'BLOBS_DENIED', 'BLOBS_UNAVAILABLE', 'BLOB_DAMAGED'):
            self.assertEqual(grown['litags_store_errors_total{reason="%s"}' % reason], 0)
        self.assertEqual(after["litags_store_up"], 1)

    def test_the_queue_has_an_age_and_training_a_rate(self):
        running = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        waiting = self.submit("--iterations", "20")
        self.wait_for(lambda: self.metric("litags_iterations_per_second") > 0, "a rate")
        now = metrics_of(self.server)
        self.assertEqual(now['litags_jobs{state="RUNNING"}'], 1)
        self.assertEqual(now['litags_jobs{state="QUEUED"}'], 1)
        self.wait_for(lambda: self.metric("litags_queue_age_seconds") > 0.2, "an age")
        self.litags("cancel", running)
        self.litags("watch", waiting)
        now = metrics_of(self.server)
        self.assertEqual(now['litags_jobs{state="QUEUED"}'], 0)
        self.assertEqual(now["litags_queue_age_seconds"], 0)
        self.assertEqual(now["litags_iterations_per_second"], 0)

    def test_a_worker_that_is_killed_is_counted(self):
        job = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.state(job) == RUNNING, "the job runs")
        before = self.metric("litags_worker_restarts_total")
        children = subprocess.run(["pgrep", "-P", str(self.server.process.pid), WORKER_PROGRAM[:15]],
                                  stdout=subprocess.PIPE, text=True).stdout.split()
        self.assertEqual(len(children), 1)
        os.kill(int(children[0]), signal.SIGKILL)
        self.wait_for(lambda: self.metric("litags_worker_restarts_total") == before + 1, "a restart")
        self.litags("cancel", job)

    def test_no_label_names_a_client_or_a_job(self):
        self.finished_job()
        labels = {name for key in metrics_of(self.server) for name in re.findall(r'(\w+)="', key)}
        self.assertLessEqual(labels, {"state", "method", "code", "reason", "le", "handler",
                                      "quantile"})


class Health(unittest.TestCase):
    wait_for = harness.ServiceTest.wait_for

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="litags-health-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def start(self, program):
        server = harness.Server(self.folder, program=program)
        self.addCleanup(server.stop)
        channel = grpc.insecure_channel(server.address, options=[("grpc.enable_http_proxy", 0)])
        self.addCleanup(channel.close)
        return channel

    def test_all_programs_name_the_same_version(self):
        versions = {subprocess.run([os.path.join(BIN, program), "--version"], check=True,
                                   stdout=subprocess.PIPE, text=True).stdout
                    for program in ("litags", SERVER_PROGRAM, WORKER_PROGRAM)}
        self.assertEqual(len(versions), 1, versions)
        self.assertRegex(versions.pop(), r"^\d+\.\d+\.\d+\n$")

    def test_a_well_server_serves_everything(self):
        channel = self.start(os.path.join(BIN, SERVER_PROGRAM))
        for service in ("", "litags.v1.ReconstructionService", "litags.v1.RenderService",
                        "litags.v1.ModelService"):
            self.assertEqual(health_of(channel, service), SERVING, service)

    def test_reflection_lists_the_services(self):
        listed = services_of(self.start(os.path.join(BIN, SERVER_PROGRAM)))
        for service in ("ReconstructionService", "RenderService", "ModelService"):
            self.assertIn(f"litags.v1.{service}".encode(), listed)

    def test_workers_that_do_not_start_are_no_health_but_pictures_are_served(self):
        # The server looks for its worker beside itself.
        program = os.path.join(self.folder, SERVER_PROGRAM)
        shutil.copy(os.path.join(BIN, SERVER_PROGRAM), program)
        worker = os.path.join(self.folder, WORKER_PROGRAM)
        with open(worker, "w") as file:
            file.write("#!/bin/sh\nexit 1\n")
        os.chmod(worker, 0o755)
        channel = self.start(program)
        self.wait_for(lambda: health_of(channel) == NOT_SERVING, "no health")
        self.assertEqual(health_of(channel, "litags.v1.ReconstructionService"), NOT_SERVING)
        self.assertEqual(health_of(channel, "litags.v1.RenderService"), SERVING)


class Backup(harness.ServiceTest):

    def test_a_copy_of_the_folder_of_a_stopped_server_brings_everything_back(self):
        done = self.finished_job()
        running = self.submit("--iterations", "500", names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.state(running) == RUNNING, "the job runs")
        self.server.stop()
        elsewhere = tempfile.mkdtemp(dir=self.class_folder)
        shutil.copytree(self.server.data, os.path.join(elsewhere, "data"))
        shutil.rmtree(self.server.data)
        type(self).server = harness.Server(elsewhere)
        self.litags("render", done, "--camera", "a.png", "-o",
                    os.path.join(self.folder, "view.png"))
        self.litags("watch", running)


if __name__ == "__main__":
    unittest.main(verbosity=2)
