"""OK is true: uploads that lost something are no success, and a finished scene stays one."""

import io
import os
import re
import unittest
import zipfile

import grpc
from google.protobuf import duration_pb2

import harness
from harness import CANCELLED, FAILED, SUCCEEDED, job_pb2, rpc
from litags.v1 import model_service_pb2 as model

INVALID = grpc.StatusCode.INVALID_ARGUMENT
FULL = grpc.StatusCode.RESOURCE_EXHAUSTED
NOT_UTF8 = b"caf\xe9.png"


class Uploads(harness.ServiceTest):

    def job(self):
        return self.jobs.CreateJob(rpc.CreateJobRequest()).name

    def upload_bytes(self, messages):
        """UploadImages of messages as bytes, whatever they hold."""
        return self.channel.stream_unary(
            "/litags.v1.ReconstructionService/UploadImages",
            response_deserializer=rpc.UploadImagesResponse.FromString)(iter(messages))

    def packed(self, job, files):
        return [message.SerializeToString() for message in self.upload(job, files, end=False)]

    def archive(self, entries):
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as zipped:
            for name, data in entries:
                zipped.writestr(name, data)
        return packed.getvalue()

    def upload_archives(self, job, archives):
        def messages():
            for message in self.upload(job, archives):
                if message.HasField("file"):
                    message.file.role = rpc.FILE_ROLE_ARCHIVE
                yield message
        return self.jobs.UploadImages(messages())

    def test_messages_that_do_not_parse_are_errors_and_not_the_end(self):
        photo = harness.png()
        for bad in (b"\xff\xff\xff\xff", b"\x12\x05\x0a\x03\xff\xfea", b"\x0a"):
            job = self.job()
            messages = self.packed(job, [("a.png", photo)]) + [bad] + \
                self.packed(job, [("b.png", photo)])[1:]
            self.assert_refused(lambda: self.upload_bytes(messages), INVALID,
                                "MESSAGE_UNREADABLE", "", "not UTF-8")
            self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=job)).photos, 1)

    def test_a_stream_whose_end_was_lost_is_told_by_its_count(self):
        job = self.job()
        both = self.packed(job, [("a.png", harness.png(seed=1)), ("b.png", harness.png(seed=2))])
        end = rpc.UploadImagesRequest(end=rpc.UploadEnd(files=2)).SerializeToString()
        self.assert_refused(lambda: self.upload_bytes(both[:3] + [end]), INVALID,
                            "UPLOAD_INCOMPLETE", "end.files", "2 files were sent and 1 came")
        self.assert_refused(lambda: self.upload_bytes(both), INVALID, "UPLOAD_INCOMPLETE", "end",
                            "2 files came")
        self.assertEqual(self.upload_bytes(both + [end]).files_received, 2)

    def test_an_answer_names_a_hundred_files_that_were_skipped_at_most(self):
        archives = [(f"{k}.zip", self.archive([(f"{k}_{i}.txt", "x") for i in range(60)]))
                    for k in range(3)]
        answer = self.upload_archives(self.job(), archives)
        self.assertEqual((len(answer.skipped), answer.skipped_total), (100, 180))

    def test_what_the_engine_would_refuse_is_refused_in_an_archive_too(self):
        padded = self.archive([("transforms.json", b'{"frames": []}' + b" " * (16 << 20))])
        self.assert_refused(lambda: self.upload_archives(self.job(), [("a.zip", padded)]), FULL,
                            "FILE_TOO_LARGE", "cameras[transforms.json]", "16777216")

    def test_the_client_says_which_photos_of_a_folder_cannot_be_sent(self):
        folder = self.photos(("a.png", "b.png", "two\nlines.png", "up\\down.png"))
        os.symlink("nowhere", os.path.join(folder, "gone.png"))
        with open(os.path.join(os.fsencode(folder), NOT_UTF8), "wb") as file:
            file.write(harness.png(seed=9))
        before = self.litags("list", "--json")[0]
        refused = (("--strict", r"caf\?\.png: the file's name is not UTF-8; rename it"),
                   ("--name=Two photos", r"two\?lines\.png is left out"))
        for option, words in refused:
            out, err = self.litags("submit", folder, option, exit_code=2)
            self.assertEqual(out, "")
            self.assertRegex(err, words)
            self.assertIn("BAD_FILE_NAME", err)
            self.assertEqual(self.litags("list", "--json")[0], before)
        with open(os.path.join(folder, "c.png"), "wb") as file:
            file.write(harness.png(seed=10))
        out, err = self.litags("submit", folder)
        for name, why in (("caf?.png", "not UTF-8"), ("gone.png", "No such file"),
                          ("two?lines.png", "control character"), ("up\\down.png", "separator")):
            self.assertRegex(err, f"(?m)^{re.escape(name)} is left out: .*{why}")
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=out.strip())).photos, 3)


class Results(harness.ServiceTest):

    def scene(self, job):
        parts = list(self.models.ExportModel(model.ExportModelRequest(
            name=job, format=model.MODEL_FORMAT_PLY_FULL)))
        return parts[0].header.iteration, b"".join(part.chunk for part in parts[1:])

    def resume(self, job, **options):
        self.jobs.ResumeJob(rpc.ResumeJobRequest(name=job,
                                                 options=job_pb2.JobOptions(**options)))

    def get(self, job):
        return self.jobs.GetJob(rpc.GetJobRequest(name=job))

    def assert_finished_scene(self, job, state, scene):
        self.wait_for(lambda: self.state(job) in (SUCCEEDED, FAILED, CANCELLED), "the job's end")
        found = self.get(job)
        self.assertEqual((found.state, found.report.iterations, found.snapshot_iteration),
                         (state, 40, 40), found)
        self.assertEqual(self.scene(job), scene)

    def test_a_finished_scene_outlives_resumes_that_come_to_nothing(self):
        job = self.submit("--iterations", "40", "--preview-every", "10", "--checkpoint-every", "10",
                          names=("slow.png", "b.png", "c.png"))
        self.litags("watch", job)
        scene = self.scene(job)
        self.assertEqual(scene[0], 40)

        self.resume(job, iterations=100000)
        self.wait_for(lambda: self.get(job).snapshot_iteration > 40, "a newer snapshot")
        self.assertGreater(self.scene(job)[0], 40)
        self.jobs.CancelJob(rpc.CancelJobRequest(name=job))
        self.assert_finished_scene(job, CANCELLED, scene)
        self.assertIn("the finished scene of 40 iterations is still there",
                      self.litags("show", job)[0])

        self.jobs.ResumeJob(rpc.ResumeJobRequest(
            name=job, policy=job_pb2.JobPolicy(max_run_time=duration_pb2.Duration(seconds=1))))
        self.assert_finished_scene(job, FAILED, scene)
        self.assertEqual(self.get(job).error.detail.reason, "RUN_TIME_EXCEEDED")
        self.assertIn("the finished scene of 40 iterations is still there",
                      "".join(self.litags("watch", job, exit_code=1)))

    def test_a_job_that_failed_takes_other_files(self):
        job = self.submit(names=("fail.png", "b.png", "c.png"))
        self.litags("watch", job, exit_code=1)
        self.jobs.UploadImages(self.upload(job, [("d.png", harness.png(seed=7))]))
        found = self.get(job)
        self.assertEqual((found.state, found.photos), (job_pb2.JOB_STATE_UPLOADING, 4))
        self.jobs.StartJob(rpc.StartJobRequest(name=job))

    def test_no_job_is_started_for_a_depth_network_that_is_not_there(self):
        job = self.jobs.CreateJob(rpc.CreateJobRequest(options=job_pb2.JobOptions(
            depth_source=job_pb2.DEPTH_SOURCE_NETWORK))).name
        self.jobs.UploadImages(self.upload(job, [(f"{i}.png", harness.png(seed=i))
                                                 for i in range(3)]))
        self.finished_job()  # a worker is there
        self.assert_refused(lambda: self.jobs.StartJob(rpc.StartJobRequest(name=job)),
                            grpc.StatusCode.FAILED_PRECONDITION, "DEPTH_MODEL_MISSING",
                            "options.depth_source", "--depth-model")

    def test_errors_of_jobs_and_calls_name_no_place_of_the_server(self):
        job = self.submit(names=("fail.png", "b.png", "c.png"))
        self.litags("watch", job, exit_code=1)
        self.assertNotIn(self.class_folder, str(self.get(job)))
        finished, tmp = self.finished_job(), self.server.data + "/tmp"
        os.rename(tmp, tmp + "-gone")
        self.addCleanup(os.rename, tmp + "-gone", tmp)
        with self.assertRaises(grpc.RpcError) as caught:
            self.scene(finished)
        self.assertNotIn(self.class_folder, caught.exception.details())


if __name__ == "__main__":
    unittest.main(verbosity=2)
