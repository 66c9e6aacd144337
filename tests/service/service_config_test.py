"""proto/litags/v1/service_config.json, which clients of any language give to gRPC: calls that may be
repeated are, and no others."""

import collections
import concurrent.futures
import json
import os
import unittest

import grpc

import harness
from harness import rpc
from litags.v1 import model_service_pb2 as model
from litags.v1 import model_service_pb2_grpc
from litags.v1 import reconstruction_service_pb2_grpc
from litags.v1 import render_service_pb2 as render
from litags.v1 import render_service_pb2_grpc

# A second one without a request_id or allow_missing is refused although the first one arrived; an
# upload goes on where QueryUpload says.
NOT_REPEATED = {"StartJob", "ResumeJob", "DeleteJob", "DeleteFile", "BatchDeleteJobs",
                "UploadImages"}
FAILURES = 2


class Flaky(grpc.GenericRpcHandler):
    """Fails with UNAVAILABLE some times for each method, then answers with an empty message."""

    def __init__(self):
        self.calls = collections.Counter()

    def service(self, details):
        method = details.method.split("/")[-1]

        def answer(_, context):
            self.calls[method] += 1
            if self.calls[method] <= FAILURES:
                context.abort(grpc.StatusCode.UNAVAILABLE, "restarting")
            return b""

        def stream(request, context):
            yield answer(request, context)

        if method in ("WatchJob", "RenderPath", "ExportModel"):
            return grpc.unary_stream_rpc_method_handler(stream)
        return grpc.unary_unary_rpc_method_handler(answer)


class ServiceConfig(unittest.TestCase):

    def setUp(self):
        with open(os.environ["LITAGS_SERVICE_CONFIG"]) as file:
            self.config = file.read()
        self.service = Flaky()
        server = grpc.server(concurrent.futures.ThreadPoolExecutor(4), handlers=(self.service,))
        port = server.add_insecure_port("127.0.0.1:0")
        server.start()
        self.addCleanup(server.stop, None)
        channel = grpc.insecure_channel(
            f"127.0.0.1:{port}", options=[("grpc.service_config", self.config)])
        self.addCleanup(channel.close)
        self.jobs = reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel)
        self.pictures = render_service_pb2_grpc.RenderServiceStub(channel)
        self.models = model_service_pb2_grpc.ModelServiceStub(channel)

    def test_calls_that_may_be_repeated_are(self):
        self.jobs.CreateJob(rpc.CreateJobRequest(request_id="a"), timeout=harness.PATIENCE_S)
        self.jobs.GetJob(rpc.GetJobRequest(name="jobs/a"), timeout=harness.PATIENCE_S)
        self.assertEqual(len(list(self.jobs.WatchJob(rpc.WatchJobRequest(name="jobs/a"),
                                                     timeout=harness.PATIENCE_S))), 1)
        self.pictures.RenderView(render.RenderViewRequest(name="jobs/a"),
                                 timeout=harness.PATIENCE_S)
        self.assertEqual(len(list(self.models.ExportModel(
            model.ExportModelRequest(name="jobs/a"), timeout=harness.PATIENCE_S))), 1)
        self.assertEqual(set(self.service.calls.values()), {FAILURES + 1}, self.service.calls)

    def test_calls_that_may_not_be_repeated_are_made_once(self):
        for call, request in ((self.jobs.StartJob, rpc.StartJobRequest(name="jobs/a")),
                              (self.jobs.ResumeJob, rpc.ResumeJobRequest(name="jobs/a")),
                              (self.jobs.DeleteJob, rpc.DeleteJobRequest(name="jobs/a"))):
            with self.assertRaises(grpc.RpcError) as raised:
                call(request, timeout=harness.PATIENCE_S)
            self.assertEqual(raised.exception.code(), grpc.StatusCode.UNAVAILABLE)
        self.assertEqual(set(self.service.calls.values()), {1}, self.service.calls)

    def test_every_call_is_in_it_or_left_out_on_purpose(self):
        names = json.loads(self.config)["methodConfig"][0]["name"]
        whole = {name["service"] for name in names if "method" not in name}
        single = {(name["service"], name["method"]) for name in names if "method" in name}
        left_out = set()
        for module in (rpc, render, model):
            for service in module.DESCRIPTOR.services_by_name.values():
                if service.full_name in whole:
                    whole.remove(service.full_name)
                    continue
                for method in service.methods:
                    if (service.full_name, method.name) in single:
                        single.remove((service.full_name, method.name))
                    else:
                        left_out.add(method.name)
        self.assertEqual(left_out, NOT_REPEATED)
        self.assertEqual((whole, single), (set(), set()))  # nothing that is not there


if __name__ == "__main__":
    unittest.main()
