"""What the example programs of other languages must do, whatever they are written in."""

import os
import pathlib
import subprocess
from concurrent import futures

import grpc

import certificates
import harness
from litags.v1 import errors_pb2  # found by harness
from litags.v1.render_service_pb2 import RenderedView
from security_test import run_server

SOURCE = pathlib.Path(__file__).resolve().parents[2]
SKIPPED = 77  # what CTest takes for "skipped": SKIP_RETURN_CODE


class Lost(Exception):
    """An answer that does not arrive; its arguments are the code in its place, and a reason if the
    service says so itself."""


class Program:
    """Mixed into a ServiceTest. `command`: the program, without arguments; `option`: what stands
    before the number of iterations; `scene_name`: of the file that it writes."""

    command = ()
    option = ()
    scene_name = "scene.ply"

    def start(self, photos, address, iterations, **environment):
        self.picture = pathlib.Path(self.folder, "view.png")
        self.scene = pathlib.Path(self.folder, self.scene_name)
        return subprocess.Popen(
            [*map(str, self.command), photos, self.picture, self.scene, *self.option,
             str(iterations)],
            env=dict(os.environ, LITAGS_SERVER=address, NO_PROXY="127.0.0.1", **environment),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def finish(self, process):
        try:
            return process.communicate(timeout=5 * harness.PATIENCE_S)  # a call is tried for a minute
        finally:
            process.kill()

    def run_program(self, *args, exit_code=0, **environment):
        """Returns (stdout, stderr)."""
        process = self.start(*args, **environment)
        out, err = self.finish(process)
        self.assertEqual(process.returncode, exit_code, err)
        return out, err


class Example(Program):

    def test_photos_become_a_picture_and_a_scene_though_the_watch_is_cut(self):
        proxy = self.new_proxy()
        # The first photo has no camera, and the folder's name means other folders to a shell.
        photos = os.path.join(self.folder, "night [1]")
        os.rename(self.photos(("no-camera.png", "slow.png", "x.png", "y.jpg")), photos)
        process = self.start(photos, proxy.address, 150)
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "RUNNING" in line:
                proxy.cut()
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 0, err)
        self.assertGreaterEqual(proxy.connections, 2)
        # No event twice, and none missing.
        self.assertEqual([sum(state in line for line in lines) for state in
                          ("QUEUED", "RUNNING", "SUCCEEDED")], [1, 1, 1], lines)
        self.assertEqual(harness.png_size(self.picture.read_bytes()), (64, 48))
        self.assertTrue(self.scene.read_bytes().startswith(b"ply\n"))

    def test_what_is_refused_is_said_with_its_reason_and_field(self):
        process = self.start(self.photos(), self.server.address, -1)
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1, err)
        self.assertRegex(err, r"BAD_OPTION\s+options.iterations")

    def test_a_job_that_fails_says_why(self):
        process = self.start(self.photos(("fail.png", "b.png", "c.png")), self.server.address, 40)
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1)
        self.assertIn("take photos that overlap more", err)

    def test_a_picture_beyond_the_4_mib_that_grpc_takes_by_default_is_received(self):
        picture = harness.large_png(width=1280, height=1200)
        self.assertGreater(len(picture), 4 << 20)

        def with_picture(call, answer):
            if call == "RenderView":
                view = RenderedView.FromString(answer)
                view.data = picture
                answer = view.SerializeToString()
            return answer

        self.run_program(self.photos(), self.relay(with_picture), 20)
        self.assertEqual(self.picture.read_bytes(), picture)

    def test_calls_whose_answers_are_lost_are_made_again(self):
        calls = {"CreateJob", "UploadImages", "StartJob", "ListCameras", "RenderView", "ExportModel"}
        left = set(calls)

        def lose_the_first(call, answer):
            if call in left:
                left.remove(call)
                raise Lost(grpc.StatusCode.UNAVAILABLE)
            return answer

        before = self.count_jobs()
        self.run_program(self.photos(), self.relay(lose_the_first), 20)
        self.assertEqual((left, self.count_jobs()), (set(), before + 1))

    def test_a_job_is_named_though_it_cannot_be_followed_to_its_end(self):
        def lose_the_cameras(call, answer):
            if call == "ListCameras":
                raise Lost(grpc.StatusCode.INTERNAL)
            return answer

        out, _ = self.run_program(self.photos(), self.relay(lose_the_cameras), 20, exit_code=1)
        self.assertRegex(out, r"\A\s*jobs/\w+\n")

    def test_a_job_that_may_run_is_not_deleted(self):
        for lost in (Lost(grpc.StatusCode.INTERNAL),
                     Lost(grpc.StatusCode.UNAVAILABLE, "STORE_OUTCOME_UNKNOWN")):
            def lose_start(call, answer, lost=lost):
                if call == "StartJob":
                    raise lost
                return answer

            with self.subTest(lost=lost):
                before = self.count_jobs()
                _, err = self.run_program(self.photos(), self.relay(lose_start), 20, exit_code=1)
                self.assertRegex(err, r"jobs/\w+ may have been started")
                self.assertEqual(self.count_jobs(), before + 1)

    def count_jobs(self):
        return len(self.jobs.ListJobs(harness.rpc.ListJobsRequest(page_size=1000)).jobs)

    def relay(self, pass_on):
        """A server that answers as the service does, but with pass_on(call, answer) for each answer."""

        class Relay(grpc.GenericRpcHandler):

            def service(self, details):
                forward = channel.stream_stream(details.method)

                def answers(requests, context):
                    try:
                        for answer in forward(requests):
                            yield pass_on(details.method.rpartition("/")[2], answer)
                    except Lost as lost:
                        code, *reasons = lost.args
                        status = errors_pb2.RpcStatus(code=code.value[0])
                        for reason in reasons:
                            status.details.add().Pack(errors_pb2.ErrorDetail(reason=reason))
                        if reasons:
                            context.set_trailing_metadata(
                                [("grpc-status-details-bin", status.SerializeToString())])
                        context.abort(code, "the answer is lost")
                    except grpc.RpcError as error:
                        context.abort(error.code(), error.details())

                return grpc.stream_stream_rpc_method_handler(answers)

        channel = self.channel
        relay = grpc.server(futures.ThreadPoolExecutor(8), handlers=(Relay(),))
        port = relay.add_insecure_port("127.0.0.1:0")
        relay.start()
        self.addCleanup(relay.stop, None)
        return f"127.0.0.1:{port}"


class Silent(Program):
    """A server that falls silent, as if its machine had died."""

    @classmethod
    def make_server(cls):
        return harness.Server(cls.class_folder, extra=("--min-ping", "0.5"))

    def test_a_watch_goes_on_elsewhere(self):
        proxy = self.new_proxy()
        process = self.start(self.photos(("slow.png", "b.png", "c.png")), proxy.address, 150,
                             LITAGS_KEEPALIVE="1")
        for line in process.stdout:
            if "RUNNING" in line:
                proxy.silent = True
                break
        self.wait_for(lambda: proxy.connections > 1, "another connection")
        proxy.silent = False
        proxy.cut()
        out, err = self.finish(process)
        self.assertEqual(process.returncode, 0, err)
        self.assertIn("SUCCEEDED", out)


class Refused(Program):
    """What the service does not take."""

    def states(self):
        return sorted(job.state for job in self.jobs.ListJobs(harness.rpc.ListJobsRequest()).jobs)

    def test_photos_that_cannot_be_read_are_left_out(self):
        photos = self.photos(("a.png", "b.png", "c.png", "d.png"))
        pathlib.Path(photos, "bad.jpg").write_bytes(b"no photo")
        pathlib.Path(photos, "empty.png").touch()
        pathlib.Path(photos, "._a.png").write_bytes(b"what a Mac leaves on other disks")
        pathlib.Path(photos, "short.png").write_bytes(harness.large_png()[:2_000_000])
        _, err = self.run_program(photos, self.server.address, 20)
        for name in ("bad.jpg", "empty.png", "short.png"):
            self.assertRegex(err, f"{name} is left out: ")
        self.assertNotRegex(err, "[a-d].png is left out")
        self.assertTrue(self.scene.exists())

    def test_a_job_that_is_refused_is_deleted(self):
        before = self.states()
        _, err = self.run_program(self.photos(("a.png", "b.png")), self.server.address, 20,
                                  exit_code=1)
        self.assertIn("TOO_FEW_PHOTOS", err)
        self.assertEqual(self.states(), before)

    def test_a_scene_of_an_ending_that_it_cannot_write_is_refused_before_there_is_a_job(self):
        before = self.states()
        self.scene_name = "scene.splatt"
        _, err = self.run_program(self.photos(), self.server.address, 20, exit_code=1)
        self.assertIn("scene.splatt", err)
        self.assertEqual(self.states(), before)

    def test_a_folder_that_is_not_there_is_named_in_a_line(self):
        _, err = self.run_program("/no/such/folder", self.server.address, 20, exit_code=1)
        self.assertRegex(err, r"\A[^\n]*/no/such/folder[^\n]*\n\Z")
        before = self.states()
        self.scene_name = "gone/scene.ply"
        _, err = self.run_program(self.photos(), self.server.address, 20, exit_code=1)
        self.assertIn("gone", err)
        self.assertEqual(self.states(), before)


class Secure(Program):
    """A server with TLS and tokens, which the environment names as it does for litags."""

    @classmethod
    def make_server(cls):
        at = lambda name: os.path.join(cls.class_folder, name)  # noqa: E731
        tls = certificates.make(cls.class_folder)
        cls.ca = at("ca.crt")
        _, token, _ = run_server("token", "alice", "--tokens", at("tokens"))
        cls.token = token.strip()
        return harness.Server(cls.class_folder, extra=(*tls, "--tokens", at("tokens")))

    def test_with_a_token_and_the_certificates_of_a_file(self):
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TOKEN=self.token,
                         LITAGS_TLS_CA=self.ca)
        self.assertTrue(self.scene.exists())

    def test_with_the_certificates_of_the_system(self):
        # How Go, Node.js and gRPC name them.
        system = {name: self.ca for name in ("SSL_CERT_FILE", "NODE_EXTRA_CA_CERTS",
                                             "GRPC_DEFAULT_SSL_ROOTS_FILE_PATH")}
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TOKEN=self.token,
                         LITAGS_TLS="1", **system)
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TOKEN=self.token,
                         LITAGS_TLS="1", exit_code=1)

    def test_with_the_token_of_a_file_and_another_name_of_the_server(self):
        path = os.path.join(self.folder, "token")
        pathlib.Path(path).write_text(self.token + "\n")
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TOKEN_FILE=path,
                         LITAGS_TLS_CA=self.ca, LITAGS_TLS_NAME="localhost")
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TOKEN_FILE=path,
                         LITAGS_TLS_CA=self.ca, LITAGS_TLS_NAME="elsewhere", exit_code=1)

    def test_a_missing_token_is_refused(self):
        _, err = self.run_program(self.photos(), self.server.address, 20, LITAGS_TLS_CA=self.ca,
                                  exit_code=1)
        self.assertIn("TOKEN_MISSING", err)

    def test_a_token_is_not_sent_unencrypted_to_another_machine(self):
        _, err = self.run_program(self.photos(), "192.0.2.1:1", 20, LITAGS_TOKEN=self.token,
                                  LITAGS_TLS="0", exit_code=1)
        self.assertIn("unencrypted", err)


class Mutual(Program):
    """A server that knows its clients by their certificates."""

    @classmethod
    def make_server(cls):
        at = lambda name: os.path.join(cls.class_folder, name)  # noqa: E731
        tls = certificates.make(cls.class_folder)
        certificates.issue(cls.class_folder, "alice")
        cls.at = staticmethod(at)
        return harness.Server(cls.class_folder, extra=(*tls, "--tls-client-ca", at("ca.crt")))

    def test_with_a_certificate_and_its_key(self):
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TLS_CA=self.at("ca.crt"),
                         LITAGS_TLS_CERT=self.at("alice.crt"), LITAGS_TLS_KEY=self.at("alice.key"))
        self.assertTrue(self.scene.exists())

    def test_without_a_certificate_nobody_comes_in(self):
        self.run_program(self.photos(), self.server.address, 20, LITAGS_TLS_CA=self.at("ca.crt"),
                         exit_code=1)

    def test_a_certificate_without_its_key_is_told(self):
        _, err = self.run_program(self.photos(), self.server.address, 20,
                                  LITAGS_TLS_CA=self.at("ca.crt"),
                                  LITAGS_TLS_CERT=self.at("alice.crt"), exit_code=1)
        self.assertIn("LITAGS_TLS_CERT and LITAGS_TLS_KEY belong together", err)
