"""Single calls of the package of client/python: tries, exports, views, uploads that are stopped."""

import contextlib
import io
import os
import pathlib
import re
import signal
import struct
import sys
import threading
import unittest
import zlib
from concurrent import futures
from unittest import mock

SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tests/support"))
import python_package  # noqa: E402

python_package.run_installed()

import grpc  # noqa: E402
import harness  # noqa: E402
import litags  # noqa: E402
import litags.files  # noqa: E402
import litags.formats  # noqa: E402
from google.protobuf import empty_pb2  # noqa: E402
from litags.v1 import errors_pb2, job_pb2, model_service_pb2, render_service_pb2  # noqa: E402
from litags.v1 import reconstruction_service_pb2 as rpc  # noqa: E402
from litags.v1 import reconstruction_service_pb2_grpc as jobs_grpc  # noqa: E402


class BrokenUploads(jobs_grpc.ReconstructionServiceServicer):
    """A service whose first uploads break for the reasons given; `calls` are those that came."""

    def __init__(self, *reasons):
        self.reasons, self.calls = list(reasons), []
        self.lost_start, self.pass_time = None, lambda: None

    def CreateJob(self, request, context):
        return job_pb2.Job(name="jobs/1", state=job_pb2.JOB_STATE_UPLOADING)

    def QueryUpload(self, request, context):
        return rpc.QueryUploadResponse(files=[rpc.FileStatus() for _ in request.files])

    def UploadImages(self, messages, context):
        self.calls.append("UploadImages")
        for _ in messages:
            pass
        self.pass_time()
        if not self.reasons:
            return rpc.UploadImagesResponse()
        code, reason = self.reasons.pop(0)
        status = errors_pb2.RpcStatus()
        status.details.add().Pack(errors_pb2.ErrorDetail(reason=reason))
        context.set_trailing_metadata([("grpc-status-details-bin", status.SerializeToString())])
        context.abort(code, "send the rest")

    def StartJob(self, request, context):
        self.calls.append("StartJob")
        if self.lost_start:
            context.abort(self.lost_start, "the answer is lost")
        return job_pb2.Job(name="jobs/1", state=job_pb2.JOB_STATE_QUEUED)

    def DeleteJob(self, request, context):
        self.calls.append("DeleteJob")
        return empty_pb2.Empty()


class Resumed(jobs_grpc.ReconstructionServiceServicer):
    """A service whose job is resumed between its end and the question how it stands."""

    def __init__(self):
        self.watched = []

    def WatchJob(self, request, context):
        self.watched.append(request.after_event)
        yield job_pb2.JobEvent(number=request.after_event + 1)

    def GetJob(self, request, context):
        return job_pb2.Job(name=request.name, state=job_pb2.JOB_STATE_RUNNING
                           if len(self.watched) == 1 else job_pb2.JOB_STATE_SUCCEEDED)


def codes(png, width, height):
    """The numbers of a 16-bit grey PNG."""
    at, data = 8, b""
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at:at + 8])
        data += png[at + 8:at + 8 + length] if kind == b"IDAT" else b""
        at += 12 + length
    data, row, found = zlib.decompress(data), bytes(2 * width + 2), []
    for y in range(height):
        above, row = row, bytearray(2)  # one pixel of 0 before each row
        how, *rest = data[y * (2 * width + 1):(y + 1) * (2 * width + 1)]
        for i, byte in enumerate(rest):
            left, up, corner = row[i], above[i + 2], above[i]
            near = min((left, up, corner), key=lambda value: abs(left + up - corner - value))
            row.append((byte + (0, left, up, (left + up) // 2, near)[how]) % 256)
        found += struct.unpack(f">{width}H", row[2:])
    return found


class Clock:
    """Time that passes only where a test says so; stands for the module."""

    now = 0.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


class Lost(grpc.RpcError):
    """What a call raises whose connection broke."""

    def code(self):
        return grpc.StatusCode.UNAVAILABLE

    def details(self):
        return "the connection broke"

    def trailing_metadata(self):
        return ()


class Broken:
    """Of a server whose every call fails after so many seconds."""

    def __init__(self, clock, seconds):
        self.clock, self.seconds, self.calls = clock, seconds, 0

    def __call__(self, *_, **__):
        return self

    def __iter__(self):
        self.calls += 1
        self.clock.sleep(self.seconds)
        raise Lost if self.calls < 50 else AssertionError("it is tried without end")

    def cancel(self):
        pass


class Calls(harness.ServiceTest):

    def client(self, address=None, **options):
        client = litags.Client(address or self.server.address, **options)
        self.addCleanup(client.close)
        return client

    def client_of(self, service, **options):
        """A client of a service that is not the server's."""
        server = grpc.server(futures.ThreadPoolExecutor(4))
        jobs_grpc.add_ReconstructionServiceServicer_to_server(service, server)
        port = server.add_insecure_port("127.0.0.1:0")
        server.start()
        self.addCleanup(lambda: server.stop(0).wait())
        return self.client(f"127.0.0.1:{port}", **options)

    def path(self, name):
        return pathlib.Path(self.folder, name)

    def names(self):
        return [job.name for job in self.jobs.ListJobs(rpc.ListJobsRequest(page_size=1000)).jobs]

    def client_with_clock(self):
        """A client of a server that has answered, and the time that it sees."""
        client, clock = self.client(), Clock()
        client.job(self.finished_job())
        patched = mock.patch("litags.client.time", clock)
        patched.start()
        self.addCleanup(patched.stop)
        return client, clock

    def test_tries_that_bring_nothing_end_however_long_each_takes(self):
        client, clock = self.client_with_clock()
        broken = Broken(clock, 30)
        client.models = mock.Mock(ExportModel=broken)
        client.pictures = mock.Mock(RenderView=lambda request, metadata: next(iter(broken)))
        for call in (lambda: client.export("1", self.path("scene.ply")),
                     lambda: client.render("1", "a.png")):
            clock.now, broken.calls = 0, 0
            with self.assertRaises(litags.LitagsError) as caught:
                call()
            self.assertEqual(caught.exception.code, grpc.StatusCode.UNAVAILABLE)
            self.assertTrue(300 < clock.now < 340, clock.now)

    def test_a_watch_of_a_quiet_job_goes_on(self):
        client, clock = self.client_with_clock()
        for seconds, end in ((60, AssertionError), (20, litags.LitagsError)):
            client.jobs = mock.Mock(WatchJob=Broken(clock, seconds))
            with self.assertRaises(end):
                list(client.watch("1"))

    def test_an_export_that_comes_further_each_time_goes_on(self):
        client, clock = self.client_with_clock()
        sizes = iter(range(1, 21))

        def export(request, metadata):
            size = next(sizes)
            yield from size * [model_service_pb2.ExportModelResponse(chunk=b"x")]
            clock.sleep(30)
            if size < 20:
                raise Lost

        client.models = mock.Mock(ExportModel=export)
        client.export("1", self.path("scene.ply"))
        self.assertEqual(self.path("scene.ply").read_bytes(), 20 * b"x")

    def test_an_upload_goes_on_that_broke_after_a_long_time(self):
        stalled = (grpc.StatusCode.DEADLINE_EXCEEDED, "UPLOAD_STALLED")
        _, clock = self.client_with_clock()
        service = BrokenUploads(stalled)
        service.pass_time = lambda: clock.sleep(400)
        self.assertEqual(self.client_of(service).submit(self.photos()), "jobs/1")
        service = BrokenUploads(*20 * [stalled])  # the second brings no more than the first
        service.pass_time = lambda: clock.sleep(200)
        with self.assertRaises(litags.LitagsError):
            self.client_of(service).submit(self.photos())
        self.assertEqual(service.calls, 3 * ["UploadImages"])

    def test_an_upload_that_is_interrupted_leaves_no_job(self):
        handler = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, handler)
        main, ended = threading.main_thread().ident, threading.Event()

        def messages(*arguments, whole=litags.files.upload_messages):
            for message in whole(*arguments):
                yield message
                if message.chunk:
                    signal.pthread_kill(main, signal.SIGINT)
                    ended.wait(harness.PATIENCE_S)

        client = self.client()
        before = self.names()
        threads = threading.active_count()
        with mock.patch("litags.files.upload_messages", messages):
            with self.assertRaises(KeyboardInterrupt):
                client.submit(self.photos(size=(73, 48)))  # which the server has not seen
            self.assertEqual(self.names(), before)
            ended.set()
        self.wait_for(lambda: threading.active_count() <= threads, "the end of the upload")

    def test_a_start_that_is_interrupted_says_that_the_job_may_run(self):
        client = self.client()
        with mock.patch.object(client, "jobs", wraps=client.jobs) as jobs, \
                self.assertLogs("litags", "WARNING") as said, \
                self.assertRaises(KeyboardInterrupt):
            jobs.StartJob.side_effect = KeyboardInterrupt
            client.submit(self.photos())
        self.assertRegex(said.output[0], r"jobs/(\w+) may have been started, see: litags show jobs/\1; "
                                         r'.*request_id="[\w-]+"')

    def test_two_exports_to_one_path_do_not_mix(self):
        begun = threading.Barrier(2)

        def export(request, metadata):
            begun.wait(harness.PATIENCE_S)
            for _ in range(100):
                yield model_service_pb2.ExportModelResponse(chunk=b"%d" % request.light)
            begun.wait(harness.PATIENCE_S)

        client = self.client()
        client.models = mock.Mock(ExportModel=export)
        with futures.ThreadPoolExecutor(2) as pool:
            exports = [pool.submit(client.export, "1", self.path("scene.ply"), light=light)
                       for light in (1, 2)]
            for export in exports:
                export.result(harness.PATIENCE_S)
        self.assertIn(self.path("scene.ply").read_bytes(), (100 * b"1", 100 * b"2"))
        self.assertEqual(os.listdir(self.folder), ["scene.ply"])

    def test_scenes_have_the_endings_of_litags(self):
        source = (SOURCE / "client/model_format.cc").read_text()
        endings = re.search(r"kEndings\[\] = \{(.*?)\n\};", source, re.DOTALL)[1]
        self.assertEqual([(ending, model_service_pb2.ModelFormat.Name(value))
                          for ending, value in litags.formats.MODEL_ENDINGS.items()],
                         re.findall(r'"(.*?)", v1::(\w+)', endings))

    def test_the_ending_says_the_format_and_no_other(self):
        client = self.client()
        client.models = mock.Mock(ExportModel=mock.Mock(return_value=[]))

        def format_of(name, **settings):
            client.export("1", self.path(name), **settings)
            (request,), _ = client.models.ExportModel.call_args
            return model_service_pb2.ModelFormat.Name(request.format).removeprefix("MODEL_FORMAT_")

        self.assertEqual(format_of("x.spz"), "SPZ")
        self.assertEqual(format_of("x.Compressed.PLY"), "COMPRESSED_PLY")
        for name in ("x.spz", "x", "ply"):
            self.assertEqual(format_of(name, format="MODEL_FORMAT_SPZ_V4"), "SPZ_V4")
        self.assertEqual(format_of("x.ply", format="MODEL_FORMAT_POINTS"), "POINTS")
        for name, settings, words in (
                ("x.points.PLY", {"format": "MODEL_FORMAT_PLY"},
                 r"MODEL_FORMAT_PLY, not \.points\.ply; call it \S*x\.ply,"),
                ("x.ply", {"format": "MODEL_FORMAT_SPZ"}, r"MODEL_FORMAT_SPZ, not \.ply; call it \S*x\.spz,"),
                ("x.glb", {"format": "MODEL_FORMAT_COLMAP"}, r"call it \S*x\.zip,"),
                ("x", {}, "x ends with none of .*, or give format"),
                ("x.obj", {}, r"x.obj ends with none of \.compressed\.ply, ")):
            with self.assertRaisesRegex(ValueError, words):
                format_of(name, **settings)

    def test_a_depth_picture_gives_the_distances_by_its_range(self):
        client, job = self.client(), self.finished_job()
        settings = {"width": 40, "channel": "CHANNEL_DEPTH"}
        exact = client.view(job, "a.png", format="PICTURE_FORMAT_RAW_FLOAT", **settings)
        self.assertEqual((exact.width, exact.height, exact.planes), (40, 30, 1))
        distances = struct.unpack("<1200f", exact.data)
        view = client.view(job, "a.png", **settings)
        self.assertEqual(view.data, client.render(job, "a.png", **settings))
        step = (view.value_max - view.value_min) / 65535
        self.assertGreater(step, 0)
        for code, distance in zip(codes(view.data, 40, 30), distances, strict=True):
            self.assertAlmostEqual(view.value_min + step * code, distance, delta=step)

    def test_a_camera_and_a_pose_are_not_given_together(self):
        pose = render_service_pb2.Pose(camera="b.png")
        client, job = self.client(), self.finished_job()
        self.assertEqual(client.render(job, pose=pose), client.render(job, "b.png"))
        with self.assertRaisesRegex(ValueError, "give one of them"):
            client.render(job, "a.png", pose=pose)

    def test_a_job_that_is_resumed_as_it_ends_is_waited_for(self):
        service = Resumed()
        done = self.client_of(service).wait("jobs/1", progress=False)
        self.assertEqual(done.state, job_pb2.JOB_STATE_SUCCEEDED)
        self.assertEqual(service.watched, [0, 1])

    def test_uploads_that_stall_go_on(self):
        service = BrokenUploads((grpc.StatusCode.DEADLINE_EXCEEDED, "UPLOAD_STALLED"),
                                (grpc.StatusCode.OUT_OF_RANGE, "OFFSET_INVALID"))
        self.assertEqual(self.client_of(service).submit(self.photos()), "jobs/1")
        self.assertEqual(service.calls, 3 * ["UploadImages"] + ["StartJob"])

    def test_uploads_that_stall_for_good_leave_the_job(self):
        service = BrokenUploads((grpc.StatusCode.DEADLINE_EXCEEDED, "UPLOAD_STALLED"))
        with self.assertRaises(litags.LitagsError) as caught:
            self.client_of(service, retry_seconds=0).submit(self.photos())
        self.assertEqual(caught.exception.reason, "UPLOAD_STALLED")
        self.assertRegex(caught.exception.message, "jobs/1 was not started and is still there")
        self.assertEqual(service.calls, ["UploadImages"])

    def test_a_start_that_was_not_answered_leaves_the_job(self):
        for code in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.INTERNAL):
            service = BrokenUploads()
            service.lost_start = code
            with self.assertRaises(litags.LitagsError) as caught:
                self.client_of(service, retry_seconds=0).submit(self.photos())
            self.assertEqual(caught.exception.code, code)
            self.assertIn("jobs/1 may have been started, see: litags show jobs/1; if it was not, "
                          "submit the same again", caught.exception.message)
            self.assertEqual(service.calls, ["UploadImages", "StartJob"])

    def test_progress_is_a_bar_where_tqdm_is_installed(self):
        client = self.client()
        job = client.submit(self.photos(), options={"iterations": 40})
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            with mock.patch.dict(sys.modules, {"tqdm": None}):
                self.assertEqual(client.wait(job).state, job_pb2.JOB_STATE_SUCCEEDED)
        self.assertEqual(said.getvalue(), "")
        bars = []

        class Bar:
            def __init__(self, desc, unit):
                self.n, self.total = 0, None
                bars.append(self)

            def __enter__(self):
                return self

            def __exit__(self, *_):
                pass

            def set_postfix_str(self, text, refresh):
                pass

            def update(self, more):
                self.n += more

        with mock.patch.dict(sys.modules, {"tqdm": mock.Mock(tqdm=Bar)}):
            client.wait(job)
        self.assertEqual([(bar.n, bar.total) for bar in bars], [(40, 40)])
        try:
            import tqdm  # noqa: F401
        except ImportError:
            return
        with contextlib.redirect_stderr(said):
            client.wait(job)
        self.assertIn(f"{job}: 100%", said.getvalue())


if __name__ == "__main__":
    unittest.main(verbosity=2)
