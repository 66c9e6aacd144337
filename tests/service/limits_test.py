"""Each limit that an operator may set holds: tiny ones are met by calls, and named by their reason.

What the limits mean in detail is tested beside the code that keeps them; here a flag that reaches
nothing is found.
"""

import contextlib
import os
import shutil
import socket
import tempfile
import unittest

import grpc

import harness
from harness import job_pb2, rpc
from litags.v1 import model_service_pb2 as model
from litags.v1 import render_service_pb2 as render

CODE = grpc.StatusCode
STRANGER = ("127.0.0.2", 0)  # one network of its own


class Stubs:
    """The services over one connection of its own."""

    def __init__(self, address, *options):
        self.channel = grpc.insecure_channel(address, options=[
            ("grpc.enable_http_proxy", 0), ("grpc.use_local_subchannel_pool", 1), *options])
        self.jobs = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(self.channel)
        self.pictures = harness.render_service_pb2_grpc.RenderServiceStub(self.channel)
        self.models = harness.model_service_pb2_grpc.ModelServiceStub(self.channel)


class Limits(unittest.TestCase):
    """Servers with a limit each, one after the other on a data folder with finished jobs."""

    assert_refused = harness.ServiceTest.assert_refused
    wait_for = harness.ServiceTest.wait_for

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="litags-limits-")
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        server = harness.Server(cls.folder)
        stubs = Stubs(server.address)
        cls.quick, cls.other, cls.heavy = (
            cls.finished_job(stubs, name) for name in ("a.png", "other.png", "heavy.png"))
        stubs.channel.close()
        server.stop()

    @staticmethod
    def new_job(stubs, first="a.png", **options):
        job = stubs.jobs.CreateJob(rpc.CreateJobRequest(**options)).name
        files = [(name, harness.png(seed=seed)) for seed, name in enumerate((first, "b.png", "c.png"))]
        stubs.jobs.UploadImages(harness.ServiceTest.upload(job, files))
        return job

    @classmethod
    def finished_job(cls, stubs, first):
        job = cls.new_job(stubs, first, options=job_pb2.JobOptions(iterations=5))
        stubs.jobs.StartJob(rpc.StartJobRequest(name=job))
        for _ in stubs.jobs.WatchJob(rpc.WatchJobRequest(name=job), timeout=harness.PATIENCE_S):
            pass
        return job

    def serve(self, *flags):
        """Stubs of a server with these flags."""
        self.server = harness.Server(self.folder, extra=("--workers", "0", *flags))
        self.addCleanup(self.server.stop)
        return self.stubs()

    def stubs(self, *options):
        stubs = Stubs(self.server.address, *options)
        self.addCleanup(stubs.channel.close)
        return stubs

    def lazy_stubs(self):
        """Stubs that take little more than what is read."""
        return self.stubs(("grpc.http2.lookahead_bytes", 1024), ("grpc.http2.bdp_probe", 0))

    def picture_request(self, job, width=32):
        settings = render.RenderSettings(width=width, format=render.PICTURE_FORMAT_PNG)
        return render.RenderViewRequest(name=job, pose=render.Pose(camera="b.png"),
                                        settings=settings)

    def picture(self, stubs, job=None, width=32):
        return stubs.pictures.RenderView(self.picture_request(job or self.quick, width),
                                         timeout=harness.PATIENCE_S)

    def refused_one(self, stubs, count):
        """Asks for so many pictures of 20 s each at once: the first that comes to nothing."""
        calls = [stubs.pictures.RenderView.future(self.picture_request(self.heavy))
                 for _ in range(count)]
        for call in calls:
            self.addCleanup(call.cancel)

        def refused():
            return [call for call in calls if call.done() and call.exception()]
        self.wait_for(refused, "a picture to be refused")
        return refused()[0].result

    # Pictures and models.

    def test_max_pixels(self):
        stubs = self.serve("--max-pixels", "1000")
        self.picture(stubs, width=32)
        self.assert_refused(lambda: self.picture(stubs, width=64), CODE.RESOURCE_EXHAUSTED,
                            "PICTURE_TOO_LARGE", "settings.width", "1000")

    def test_pictures_per_second_and_picture_burst(self):
        stubs = self.serve("--pictures-per-second", "0.01", "--picture-burst", "2")
        for _ in range(2):
            self.picture(stubs)
        for _ in range(30):  # the default rate would allow some of them
            self.assert_refused(lambda: self.picture(stubs), CODE.RESOURCE_EXHAUSTED,
                                "PICTURE_RATE_EXCEEDED", "", ".")

    def test_render_workers_and_max_waiting_pictures(self):
        stubs = self.serve("--render-workers", "1", "--max-waiting-pictures", "1")
        # One is made, one waits.
        self.assert_refused(self.refused_one(stubs, 3), CODE.RESOURCE_EXHAUSTED,
                            "RENDER_QUEUE_FULL", "", "1 pictures wait")

    def test_max_wait(self):
        stubs = self.serve("--render-workers", "1", "--max-wait", "0.5")
        self.assert_refused(self.refused_one(stubs, 2), CODE.DEADLINE_EXCEEDED, "WAITED_TOO_LONG",
                            "", ".")

    def test_render_threads(self):
        stubs = self.serve("--render-threads", "3")
        parts = stubs.models.ExportModel(model.ExportModelRequest(
            name=self.quick, format=model.MODEL_FORMAT_SPZ), timeout=harness.PATIENCE_S)
        self.assertIn(b" threads 3\n", b"".join(part.chunk for part in parts))

    def test_scene_cache(self):
        for flags, kept in ((), True), (("--scene-cache", "1"), False):
            with self.subTest(flags):
                folder = tempfile.mkdtemp(dir=self.folder)
                shutil.copytree(os.path.join(self.folder, "data"), os.path.join(folder, "data"))
                server = harness.Server(folder, extra=("--workers", "0", *flags))
                self.addCleanup(server.stop)
                stubs = Stubs(server.address)
                self.addCleanup(stubs.channel.close)
                self.picture(stubs)
                self.picture(stubs, self.other)
                shutil.rmtree(os.path.join(folder, "data", "blobs", self.quick))
                if kept:
                    self.picture(stubs)
                else:
                    with self.assertRaises(grpc.RpcError):
                        self.picture(stubs)

    def test_max_unread_bytes(self):
        stubs = self.serve("--max-unread-bytes", "1MiB")
        lazy = self.lazy_stubs()
        frames = lazy.pictures.RenderPath(render.RenderPathRequest(
            name=self.quick, orbit=render.Orbit(), frames=100, settings=render.RenderSettings(
                width=320, height=240, format=render.PICTURE_FORMAT_RAW_FLOAT)))
        next(frames)

        def refused():
            try:
                self.picture(stubs)
            except grpc.RpcError as error:
                self.assertEqual(harness.error_detail(error).reason, "RENDER_QUEUE_FULL")
                return True
        self.wait_for(refused, "answers that are not read to fill the room")
        frames.cancel()
        self.wait_for(lambda: not refused(), "the room to be free again")

    def test_max_export_bytes(self):
        stubs = self.serve("--max-export-bytes", "1MiB")
        lazy = self.lazy_stubs()
        request = model.ExportModelRequest(name=self.quick)
        unread = lazy.models.ExportModel(request)  # 600 kB, more than one client's half
        next(unread)
        with self.assertRaises(grpc.RpcError) as caught:
            list(stubs.models.ExportModel(request, timeout=1))
        self.assertEqual(caught.exception.code(), CODE.DEADLINE_EXCEEDED)
        list(unread)
        list(stubs.models.ExportModel(request, timeout=harness.PATIENCE_S))

    # Files.

    def test_max_job_bytes(self):
        stubs = self.serve("--max-job-bytes", "1000")
        self.assert_refused(lambda: self.new_job(stubs), CODE.RESOURCE_EXHAUSTED, "JOB_TOO_LARGE",
                            "images", "may have 1000")

    def test_upload_cpu_and_upload_cpu_burst(self):
        stubs = self.serve("--upload-cpu", "0.001", "--upload-cpu-burst", "0.001")
        job = stubs.jobs.CreateJob(rpc.CreateJobRequest()).name
        files = [(f"{seed}.png", harness.large_png(seed)) for seed in range(3)]
        with self.assertRaises(grpc.RpcError) as caught:  # the first one's time takes minutes
            stubs.jobs.UploadImages(harness.ServiceTest.upload(job, files), timeout=5)
        self.assertEqual(caught.exception.code(), CODE.DEADLINE_EXCEEDED)

    # Workers.

    def test_worker_cores(self):
        self.server = harness.Server(self.folder, extra=("--worker-cores", "2"))
        self.addCleanup(self.server.stop)
        stubs = self.stubs()
        jobs = [self.new_job(stubs, policy=job_pb2.JobPolicy(min_cores=cores)) for cores in (3, 2)]
        for job in jobs:
            stubs.jobs.StartJob(rpc.StartJobRequest(name=job))

        def state(job):
            return stubs.jobs.GetJob(rpc.GetJobRequest(name=job)).state
        self.wait_for(lambda: state(jobs[1]) == harness.SUCCEEDED, "the job that fits")
        self.assertEqual(state(jobs[0]), job_pb2.JOB_STATE_QUEUED)

    # Connections.

    def strangers(self, count):
        with contextlib.ExitStack() as stack:
            found = [stack.enter_context(socket.create_connection(
                ("127.0.0.1", self.server.port), source_address=STRANGER)) for _ in range(count)]
            self.addCleanup(stack.pop_all().close)
        return found

    def test_max_connections(self):
        # One network may have half of them.
        self.serve("--max-connections", "8", "--max-first-call", "1000")
        sockets = self.strangers(7)
        self.wait_for(lambda: harness.closed(sockets) >= 3, "three to be closed")

    def test_max_newcomers(self):
        self.serve("--max-newcomers", "2", "--max-first-call", "1000", "--self-call", "0")
        sockets = self.strangers(5)
        self.wait_for(lambda: harness.closed(sockets) >= 3, "three to be closed")

    def test_max_first_call(self):
        self.serve("--max-first-call", "0.5")
        [stranger] = self.strangers(1)
        self.wait_for(lambda: harness.closed([stranger]) == 1, "the silent one to be closed")

    def watch(self, stubs, job):
        """A watch that is let in: a call that has just ended may count a moment longer."""
        open_watches = []

        def is_let_in():
            open_watches.append(stubs.jobs.WatchJob(rpc.WatchJobRequest(name=job)))
            try:
                next(open_watches[-1])
            except grpc.RpcError as error:
                self.assertEqual(error.code(), CODE.UNAVAILABLE)
                return False
            return True

        self.wait_for(is_let_in, "a watch to be let in")
        return open_watches[-1]

    def test_max_connection_calls(self):
        stubs = self.serve("--max-connection-calls", "2")
        job = self.new_job(stubs)
        watches = [self.watch(stubs, job) for _ in range(2)]
        with self.assertRaises(grpc.RpcError) as caught:  # waits in the client
            stubs.jobs.GetJob(rpc.GetJobRequest(name=job), timeout=1)
        self.assertEqual(caught.exception.code(), CODE.DEADLINE_EXCEEDED)
        self.stubs().jobs.GetJob(rpc.GetJobRequest(name=job), timeout=harness.PATIENCE_S)
        for watch in watches:
            watch.cancel()

    def test_max_idle(self):
        self.serve("--max-idle", "1")
        relay = harness.CuttableProxy(self.server.port)
        self.addCleanup(relay.close)
        self.server.address = relay.address
        self.stubs().jobs.ListJobs(rpc.ListJobsRequest())
        self.wait_for(lambda: relay.closed == 1, "the idle connection to be closed")


if __name__ == "__main__":
    unittest.main(verbosity=2)
