"""Peers that die without a word: the connection stays open and nothing comes."""

import hashlib
import signal
import time
import unittest

import grpc

import harness
from harness import rpc

# Long enough that the living answer in time on a loaded machine.
KEEPALIVE_S, TIMEOUT_S = 1, 5
# From the last byte to the end: one interval until a peer is asked, the time that it has to answer.
# A loaded machine may need longer; nothing but keepalive ends these connections at all.
NOTICED_S = KEEPALIVE_S + TIMEOUT_S + 20 * harness.SLOWER


class DeadPeers(harness.ServiceTest):

    @classmethod
    def make_server(cls):
        return harness.Server(cls.class_folder, extra=(
            "--keepalive", str(KEEPALIVE_S), "--keepalive-timeout", str(TIMEOUT_S),
            "--min-ping", "0.5", "--max-streams", "1", "--max-upload-silence", "3600"))

    def setUp(self):
        super().setUp()
        self.proxy = self.new_proxy()
        self.job = self.jobs.CreateJob(rpc.CreateJobRequest()).name
        self.over = self.jobs.CreateJob(rpc.CreateJobRequest()).name
        self.jobs.CancelJob(rpc.CancelJobRequest(name=self.over))

    def stream_is_free(self):
        """Whether the one stream that the client may have is free. It is as free afterwards: the
        watch of a job that is over ends by itself."""
        try:
            list(self.jobs.WatchJob(rpc.WatchJobRequest(name=self.over)))
            return True
        except grpc.RpcError as error:
            self.assertEqual(harness.error_detail(error).reason, "TOO_MANY_STREAMS")
            return False

    def assert_within(self, seconds, condition, what):
        start = time.monotonic()
        self.wait_for(condition, what)
        self.assertLess(time.monotonic() - start, seconds, what)

    def test_client_and_server_notice_that_the_other_is_gone_from_a_quiet_watch(self):
        watch = self.start_litags("--keepalive", str(KEEPALIVE_S), "--keepalive-timeout",
                                  str(TIMEOUT_S), "watch", self.job, "--json",
                                  server=self.proxy.address)
        self.addCleanup(watch.kill)
        first = watch.stdout.readline()
        self.assertIn("UPLOADING", first)
        # Nothing happens for several intervals: both sides go on asking, and stay connected.
        time.sleep(5 * KEEPALIVE_S)
        self.assertEqual(self.proxy.connections, 1)
        self.assertFalse(self.stream_is_free())

        self.proxy.silent = True
        start = time.monotonic()
        self.assertIn("trying again", watch.stderr.readline())  # the client's word
        self.assertLess(time.monotonic() - start, NOTICED_S)
        self.assert_within(NOTICED_S, self.stream_is_free, "the server to free the stream")

        self.proxy.silent = False
        self.proxy.cut()
        self.jobs.CancelJob(rpc.CancelJobRequest(name=self.job))
        out, err = watch.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(len(out.splitlines()), 1, out + err)
        self.assertIn("CANCELLED", out)

    def test_the_server_frees_the_stream_of_an_uploader_that_is_gone(self):
        data = harness.large_png()
        with grpc.insecure_channel(self.proxy.address,
                                   options=[("grpc.enable_http_proxy", 0)]) as channel:
            stub = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel)
            stop = []

            def messages():
                for message in self.upload(self.job, [("a.png", data)]):
                    yield message
                    if message.WhichOneof("part") == "chunk":
                        break
                while not stop:  # alive, but nothing to say
                    time.sleep(0.05)

            call = stub.UploadImages.future(messages())
            query = rpc.QueryUploadRequest(name=self.job, files=[rpc.FileHeader(
                file_name="a.png", size_bytes=len(data), sha256=hashlib.sha256(data).digest())])
            self.wait_for(lambda: self.jobs.QueryUpload(query).files[0].offset > 0,
                          "the upload to begin")
            self.assertFalse(self.stream_is_free())
            self.proxy.silent = True
            self.assert_within(NOTICED_S, self.stream_is_free, "the server to free the stream")
            stop.append(True)
            call.cancel()

    def test_a_server_that_is_stopped_like_a_dead_machine_is_noticed(self):
        self.server.process.send_signal(signal.SIGSTOP)  # the kernel still acknowledges
        try:
            start = time.monotonic()
            call = self.start_litags("--retry", "0", "--keepalive", str(KEEPALIVE_S),
                                     "--keepalive-timeout", str(TIMEOUT_S), "watch", self.job)
            _, err = call.communicate(timeout=harness.PATIENCE_S)
            self.assertEqual(call.returncode, 3, err)
            self.assertLess(time.monotonic() - start, NOTICED_S + 5)  # and the time to connect
        finally:
            self.server.process.send_signal(signal.SIGCONT)


if __name__ == "__main__":
    unittest.main(verbosity=2)
