"""`litags-server move`: a server on the new stores answers as the one on the old stores did. Stores of
other kinds are server/move's."""

import os
import re
import subprocess
import tempfile
import unittest

import harness
from harness import BIN, CANCELLED, SERVER_PROGRAM, SUCCEEDED, rpc

from litags.v1 import model_service_pb2, render_service_pb2


class Move(harness.ServiceTest):

    def move(self, *args, data=None):
        """Runs the command; returns (exit code, what it says)."""
        done = subprocess.run(
            [os.path.join(BIN, SERVER_PROGRAM), "move", "--data", data or self.server.data, *args],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            timeout=harness.PATIENCE_S)
        return done.returncode, done.stdout

    def answers(self, job, with_scene):
        """All that the server says about a job to those who read."""
        record = self.jobs.GetJob(rpc.GetJobRequest(name=job))
        watch = self.jobs.WatchJob(rpc.WatchJobRequest(name=job, include_previews=True))
        said = [record.SerializeToString(), *(event.SerializeToString() for event in watch)]
        if with_scene:
            request = render_service_pb2.RenderViewRequest(name=job)
            request.pose.camera = "b.png"
            said.append(self.pictures.RenderView(request).SerializeToString())
            export = self.models.ExportModel(model_service_pb2.ExportModelRequest(name=job))
            said += [message.SerializeToString() for message in export]
        return said

    def test_a_server_on_the_new_stores_answers_as_before_and_goes_on(self):
        done = self.finished_job()
        stopped = self.submit("--iterations", "400", "--checkpoint-every", "10",
                              "--preview-every", "10", names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.jobs.GetJob(rpc.GetJobRequest(name=stopped))
                      .snapshot_iteration >= 10, "a snapshot")
        self.litags("cancel", stopped)
        self.wait_for(lambda: self.state(stopped) == CANCELLED, "the job is cancelled")
        before = [self.answers(done, True), self.answers(stopped, True)]

        new = tempfile.mkdtemp(dir=self.class_folder)
        stores = ["sqlite://" + os.path.join(new, "jobs.db"), "file://" + os.path.join(new, "blobs")]
        to = ["--to-store", stores[0], "--to-blobs", stores[1]]
        code, said = self.move(*to)
        self.assertEqual(code, 1)
        self.assertIn("another litags-server uses", said)
        self.server.stop()
        code, said = self.move(*to)
        self.assertEqual(code, 0, said)
        self.assertRegex(said, r"(?m)^jobs 2 ")
        self.assertRegex(said, r"(?m)^blobs (\d+), \d+ bytes, each read back; \1 copied now$")
        code, said = self.move(*to)
        self.assertEqual(code, 0, said)
        self.assertIn("; 0 copied now", said)

        type(self).server = harness.Server(new, port=self.server.port,
                                           extra=("--store", stores[0], "--blobs", stores[1]))
        self.litags("doctor")
        self.assertEqual([self.answers(done, True), self.answers(stopped, True)], before)
        self.litags("resume", stopped)
        self.wait_for(lambda: self.state(stopped) == SUCCEEDED, "the job goes on")
        notes = list(self.jobs.GetJob(rpc.GetJobRequest(name=stopped)).report.notes)
        self.assertTrue(any(re.search("resumed at iteration", note) for note in notes), notes)

    def test_what_is_not_there_is_not_moved(self):
        empty = tempfile.mkdtemp(dir=self.class_folder)
        code, said = self.move("--to-store", "sqlite://" + empty + "/new.db",
                               "--to-blobs", "file://" + empty + "/blobs", data=empty + "/typo")
        self.assertEqual(code, 1)
        self.assertIn("there is no job store", said)


if __name__ == "__main__":
    unittest.main()
