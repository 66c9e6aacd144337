"""The whole way in Python alone (python3-grpcio), as a script of a user would go it."""

import hashlib
import os
import unittest

import grpc

import harness
from harness import job_pb2, rpc
from litags.v1 import model_service_pb2 as model
from litags.v1 import model_service_pb2_grpc
from litags.v1 import reconstruction_service_pb2_grpc
from litags.v1 import render_service_pb2 as render
from litags.v1 import render_service_pb2_grpc


class Python(harness.ServiceTest):

    def watch_with_cuts(self, jobs, job, proxy, cuts):
        """Events of a job to its end; the connection is cut after some, and the watch resumed."""
        events, seen = [], 0
        while not events or not events[-1].HasField("state_change") or \
                events[-1].state_change.state not in (harness.SUCCEEDED, harness.FAILED):
            after = events[-1].number if events else 0
            try:
                for event in jobs.WatchJob(rpc.WatchJobRequest(name=job, after_event=after)):
                    events.append(event)
                    if cuts and len(events) >= seen + 3:
                        seen, cuts = len(events), cuts - 1
                        proxy.cut()
            except grpc.RpcError as error:
                self.assertEqual(error.code(), grpc.StatusCode.UNAVAILABLE, error)
        self.assertEqual(cuts, 0)  # all were made
        return events

    def test_submit_watch_over_cuts_render_and_export(self):
        proxy = harness.CuttableProxy(self.server.port)
        self.addCleanup(proxy.close)
        channel = grpc.insecure_channel(proxy.address, options=[
            ("grpc.enable_http_proxy", 0), ("grpc.initial_reconnect_backoff_ms", 100)])
        self.addCleanup(channel.close)
        jobs = reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel)
        pictures = render_service_pb2_grpc.RenderServiceStub(channel)
        models = model_service_pb2_grpc.ModelServiceStub(channel)

        # 100 iterations of 20 ms: long enough for two cuts.
        job = jobs.CreateJob(rpc.CreateJobRequest(
            request_id="python-" + os.path.basename(self.folder),
            options=job_pb2.JobOptions(iterations=100, preview_every=5))).name
        photos = [("slow.png", harness.png(seed=1)), ("b.png", harness.png(seed=2)),
                  ("c.png", harness.png(seed=3))]
        self.assertEqual(jobs.UploadImages(self.upload(job, photos)).files_stored, 3)
        jobs.StartJob(rpc.StartJobRequest(name=job))

        events = self.watch_with_cuts(jobs, job, proxy, cuts=2)
        self.assertGreaterEqual(proxy.connections, 3)
        done = jobs.GetJob(rpc.GetJobRequest(name=job))
        self.assertEqual(done.state, harness.SUCCEEDED)
        self.assertEqual([event.number for event in events], list(range(1, done.last_event + 1)))

        view = pictures.RenderView(render.RenderViewRequest(
            name=job, pose=render.Pose(camera="b.png"), settings=render.RenderSettings(width=32)))
        self.assertEqual(harness.png_size(view.data), (32, 24))

        parts = list(models.ExportModel(model.ExportModelRequest(
            name=job, format=model.MODEL_FORMAT_PLY)))
        scene = b"".join(part.chunk for part in parts[1:])
        self.assertEqual(len(scene), parts[0].header.size_bytes)
        self.assertTrue(scene.startswith(b"ply\n"))
        again = b"".join(part.chunk for part in models.ExportModel(
            model.ExportModelRequest(name=job, format=model.MODEL_FORMAT_PLY)))
        self.assertEqual(hashlib.sha256(scene).digest(), hashlib.sha256(again).digest())


if __name__ == "__main__":
    unittest.main(verbosity=2)
