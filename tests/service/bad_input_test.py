"""Bad input over a real socket: one clear error with its code, its field and a remedy."""

import contextlib
import json
import math
import os
import pty
import re
import socket
import subprocess
import tempfile
import threading
import unittest

import grpc

import harness
from harness import rpc
from litags.v1 import render_service_pb2 as render

INVALID = grpc.StatusCode.INVALID_ARGUMENT
PRECONDITION = grpc.StatusCode.FAILED_PRECONDITION


class BadUploads(harness.ServiceTest):

    def job(self):
        return self.jobs.CreateJob(rpc.CreateJobRequest()).name

    def refused_upload(self, files, code, reason, field, words):
        job = self.job()
        self.assert_refused(lambda: self.jobs.UploadImages(self.upload(job, files)), code, reason,
                            field, words)

    def refused_submit(self, files, reason, field, words):
        """`litags submit` of (name, bytes) pairs: exit code 2, the detail, and no job left."""
        folder = tempfile.mkdtemp(dir=self.folder)
        for name, data in files:
            with open(os.path.join(folder, name), "wb") as file:
                file.write(data)
        before = len(self.litags("list", "--json")[0].splitlines())
        out, err = self.litags("submit", folder, exit_code=2)
        self.assertEqual(out, "")
        self.assertIn(reason, err)
        self.assertIn(f"field:  {field}\n", err)
        self.assertRegex(err, words)
        self.assertEqual(len(self.litags("list", "--json")[0].splitlines()), before)

    def test_a_file_that_is_no_image(self):
        files = [("a.png", harness.png()), ("notes.jpg", b"Dear diary, " * 20)]
        self.refused_upload(files, INVALID, "IMAGE_NOT_RECOGNIZED", "images[notes.jpg]", "notes.jpg")
        self.refused_submit(files, "IMAGE_NOT_RECOGNIZED", "images[notes.jpg]", "notes.jpg")

    def test_a_file_without_bytes(self):
        files = [("a.png", harness.png()), ("empty.jpg", b"")]
        self.refused_upload(files, INVALID, "FILE_EMPTY", "images[empty.jpg]", "copy it")
        self.refused_submit(files, "FILE_EMPTY", "images[empty.jpg]", "copy it")

    def test_a_truncated_jpeg(self):
        files = [("cut.jpg", harness.jpeg_header() + b"\x00")]
        self.refused_upload(files, INVALID, "IMAGE_TRUNCATED", "images[cut.jpg]", "cut.jpg")
        self.refused_submit(files, "IMAGE_TRUNCATED", "images[cut.jpg]", "cut.jpg")

    def test_a_truncated_png(self):
        files = [("cut.png", harness.png()[:-40])]
        self.refused_upload(files, INVALID, "IMAGE_TRUNCATED", "images[cut.png]", "cut.png")

    def test_two_photos_only(self):
        files = [("a.png", harness.png()), ("b.png", harness.png(seed=1))]
        job = self.job()
        self.jobs.UploadImages(self.upload(job, files))
        self.assert_refused(lambda: self.jobs.StartJob(rpc.StartJobRequest(name=job)), PRECONDITION,
                            "TOO_FEW_PHOTOS", "images", "add some")
        self.refused_submit(files, "TOO_FEW_PHOTOS", "images", "2 photos.*at least 3")

    def test_cameras_of_other_photos(self):
        identity = [[float(row == column) for column in range(4)] for row in range(4)]
        frames = [{"file_path": f"./images/frame_{i}.png", "transform_matrix": identity} for i in range(3)]
        cameras = json.dumps({"camera_angle_x": 1.0, "w": 64, "h": 48, "frames": frames})
        path = os.path.join(self.folder, "transforms.json")
        with open(path, "w") as file:
            file.write(cameras)
        _, err = self.litags("submit", self.photos(), "--cameras", path, exit_code=2)
        self.assertIn("NO_MATCHING_CAMERAS", err)
        self.assertRegex(err, "'a.png', and one is './images/frame_0.png'")

    def test_names_that_are_paths(self):
        for name in ("../evil.png", "a/b.png", "/etc/passwd.png", "..", "a\\..\\b.png", "a\nb.png",
                     "x" * 300 + ".png", ""):
            with self.subTest(name):
                job = self.job()
                with self.assertRaises(grpc.RpcError) as caught:
                    self.jobs.UploadImages(self.upload(job, [(name, harness.png())]))
                self.assertEqual(caught.exception.code(), INVALID)
                detail = harness.error_detail(caught.exception)
                self.assertRegex(detail.reason, "FILE_NAME")
                self.assertTrue(detail.field.startswith("images["), detail.field)
        # Nothing was written beside the server's own files.
        for folder, _, names in os.walk(self.class_folder):
            self.assertFalse([n for n in names if re.search("evil|passwd", n)], folder)

    def test_bytes_that_are_not_those_announced(self):
        job = self.job()

        def messages():
            parts = list(self.upload(job, [("a.png", harness.png())]))
            parts[1].file.sha256 = bytes(32)
            yield from parts
        self.assert_refused(lambda: self.jobs.UploadImages(messages()), INVALID,
                            "FILE_DIGEST_MISMATCH", "images[a.png]", "again")

    def test_an_upload_that_ends_inside_a_file(self):
        job = self.job()
        parts = list(self.upload(job, [("a.png", harness.png())], chunk=100, end=False))
        self.assert_refused(lambda: self.jobs.UploadImages(iter(parts[:-1])), INVALID,
                            "FILE_TRUNCATED", "images[a.png]", "send the rest")

    def test_options_out_of_range(self):
        _, err = self.litags("submit", self.photos(), "--min-registered", "1.5", exit_code=2)
        self.assertIn("field:  options.min_registered", err)

    def test_times_that_are_too_long(self):
        job, photos = self.finished_job(), self.photos()
        for command, field in ((("submit", photos, "--max-run-seconds", "1e300"), "policy.max_run_time"),
                               (("submit", photos, "--keep-seconds", "1e12"), "policy.retention"),
                               (("clone", job, "--max-run-seconds", "1e12"), "policy.max_run_time"),
                               (("update", job, "--keep-seconds", "4e11"), "job.policy.retention")):
            with self.subTest(command):
                _, err = self.litags(*command, exit_code=2)
                self.assertIn(f"field:  {field}\n", err)
                self.assertIn("up to 1e9 s", err)

    def test_a_clone_that_cannot_start_is_removed(self):
        job = self.job()
        self.jobs.UploadImages(self.upload(job, [("a.png", harness.png())]))
        before = self.litags("list", "--json")[0]
        out, err = self.litags("clone", job, exit_code=2)
        self.assertEqual(out, "")
        self.assertIn("TOO_FEW_PHOTOS", err)
        self.assertRegex(err, r"jobs/\w+ was removed again")
        self.assertEqual(self.litags("list", "--json")[0], before)

    def test_options_without_effect_are_refused_before_a_job_is_made(self):
        job, photos = self.finished_job(), self.photos()
        folder = tempfile.mkdtemp(dir=self.folder)
        picture = os.path.join(folder, "v.png")
        before = self.litags("list", "--json")[0]
        for command, words in (
                (("submit", photos, "--webhook-secret", "x" * 16), "--webhook-secret needs --webhook"),
                (("submit", photos, "--frames", "20"), "--frames is for videos"),
                (("clone", job, "--frames", "20"), "--frames is for videos"),
                (("clone", job, "--depth-source", "stereo", "--method", "3dgs"),
                 "--depth-source would not be used"),
                (("clone", job, "--white-balance", "camera", "--tone", "none"),
                 "--white-balance would not be used"),
                (("submit", photos, "--depth", photos, "--depth-source", "stereo"), "--depth: the maps"),
                (("submit", photos, "--depth", photos, "--method", "3dgs"), "--depth: the maps"),
                (("submit", photos, "--depth-source", "stereo", "--method", "3dgs"),
                 "--depth-source would not be used"),
                (("submit", photos, "--white-balance", "camera", "--method", "3dgs"),
                 "--white-balance would not be used"),
                (("render", job, "--camera", "a.png", "--quality", "80", "-o", picture),
                 "--quality is of JPEG"),
                (("path", job, "--orbit", "--quality", "80", "-o", folder),
                 "--quality is of JPEG"),
                (("doctor", "--health", "--alive"), "exclude each other")):
            with self.subTest(command):
                out, err = self.litags(*command, exit_code=2)
                self.assertEqual(out, "")
                self.assertIn(words, err)
        self.assertEqual(os.listdir(folder), [])
        self.assertEqual(self.litags("list", "--json")[0], before)

    def test_folders_without_photos_are_refused_on_this_side(self):
        empty = tempfile.mkdtemp(dir=self.folder)
        for folder, words in ((os.path.join(self.folder, "none"), "there is no such folder"),
                              (empty, "folder is empty")):
            out, err = self.litags("submit", folder, exit_code=2, server="127.0.0.1:1")
            self.assertEqual(out, "")
            self.assertIn(words, err)
            self.assertIn("field:  DIR", err)


class BadRequests(harness.ServiceTest):

    def test_a_pose_with_nan(self):
        numbers = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
        numbers[3] = math.nan
        job = self.finished_job()
        pose = render.Pose(viewmat=render.Viewmat(values=numbers))
        self.assert_refused(
            lambda: self.pictures.RenderView(render.RenderViewRequest(name=job, pose=pose)), INVALID,
            "POSE_NOT_FINITE", "pose.viewmat", "finite")
        _, err = self.litags("render", job, "--pose", *map(str, numbers), "-o",
                             os.path.join(self.folder, "v.png"), exit_code=2)
        self.assertIn("POSE_NOT_FINITE", err)
        self.assertIn("field:  pose.viewmat", err)
        self.assertEqual(os.listdir(self.folder), [])

    def test_a_camera_that_is_not_there(self):
        _, err = self.litags("render", self.finished_job(), "--camera", "zebra.jpg", "-o",
                             os.path.join(self.folder, "v.png"), exit_code=4)
        self.assertIn("CAMERA_NOT_FOUND", err)
        self.assertIn(f"litags cameras {self.finished_job()}", err)

    def test_a_job_that_does_not_exist(self):
        # Of the form of an id, but of no job.
        unknown = re.sub(r"[0-9a-z]", "0", self.finished_job().removeprefix("jobs/"))
        self.assert_refused(lambda: self.jobs.GetJob(rpc.GetJobRequest(name="jobs/" + unknown)),
                            grpc.StatusCode.NOT_FOUND, "JOB_NOT_FOUND", "name", unknown)
        output = os.path.join(self.folder, "out")
        for command in (("show",), ("watch",), ("cancel",), ("resume",), ("delete",), ("cameras",),
                        ("render", "--camera", "a.png", "-o", output + ".png"),
                        ("path", "--orbit", "-o", output),
                        ("export", "-o", output + ".ply")):
            with self.subTest(command[0]):
                _, err = self.litags(command[0], unknown, *command[1:], exit_code=4)
                self.assertIn("JOB_NOT_FOUND", err)
                self.assertIn("litags list", err)

    def test_a_job_name_that_is_none(self):
        self.assert_refused(lambda: self.jobs.GetJob(rpc.GetJobRequest(name="../../etc")), INVALID,
                            "JOB_NAME_INVALID", "name", "jobs/")

    def test_a_scene_that_is_not_ready(self):
        job = self.jobs.CreateJob(rpc.CreateJobRequest()).name
        _, err = self.litags("render", job, "--camera", "a.png", "-o",
                             os.path.join(self.folder, "v.png"), exit_code=5)
        self.assertIn("SCENE_NOT_READY", err)
        self.assertIn("litags watch", err)
        self.jobs.CancelJob(rpc.CancelJobRequest(name=job))
        _, err = self.litags("render", job, "--camera", "a.png", "-o",
                             os.path.join(self.folder, "v.png"), exit_code=5)
        self.assertIn("SCENE_NOT_MADE", err)
        self.assertIn("litags show", err)

    def test_a_server_that_is_not_running_is_one_clear_line(self):
        for command in (("list",), ("submit", self.photos()), ("watch", "1"), ("doctor",)):
            with self.subTest(command[0]):
                _, err = self.litags(*command, exit_code=3, server="127.0.0.1:1")
                self.assertEqual(err.count("\n"), 1, err)
                self.assertIn("no server answers at 127.0.0.1:1: start one with \"litags-server\"",
                              err)

    def test_a_server_that_speaks_something_else_is_told(self):
        def answer(listener):
            with contextlib.suppress(OSError):
                while True:
                    with listener.accept()[0] as peer:
                        peer.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        page = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(page.close)
        threading.Thread(target=answer, args=(page,), daemon=True).start()
        for server, flag, said in (
                (f"127.0.0.1:{page.getsockname()[1]}", "--retry=120", "speaks HTTP"),
                (self.server.address, "--tls", "does not speak TLS; leave --tls")):
            _, err = self.litags(flag, "list", exit_code=3, server=server)
            self.assertIn(said, err)
            self.assertEqual(err.count("\n"), 1, err)

    def test_output_that_is_lost_is_an_error(self):
        job = self.finished_job()
        for command in (("log", job), ("list",)):
            with open("/dev/full", "wb") as full:
                done = subprocess.run([os.path.join(harness.BIN, "litags"), "--server",
                                       self.server.address, *command],
                                      stdout=full, stderr=subprocess.PIPE)
            self.assertEqual(done.returncode, 5, (command, done.stderr))

    def test_what_is_said_on_a_terminal_stands_on_a_line_of_its_own(self):
        terminal, end = pty.openpty()
        self.addCleanup(os.close, terminal)
        # As a progress line that is not at its end.
        os.write(end, b"uploading 1 of 9")
        subprocess.run([os.path.join(harness.BIN, "litags"), "--server", self.server.address,
                        "show", "no-such-job"], stderr=end)
        os.close(end)
        said = b""
        with contextlib.suppress(OSError):  # its end
            while part := os.read(terminal, 4096):
                said += part
        self.assertRegex(said, rb"^uploading 1 of 9\r\x1b\[Kerror: ")

    def test_usage_that_makes_no_sense(self):
        for command in (("frobnicate",), ("watch",), ("render", "1", "-o", "v.png"),
                        ("path", "1", "-o", "f"), ("list", "--limit", "-3")):
            with self.subTest(command):
                self.litags(*command, exit_code=2)

    def test_bad_usage_is_said_in_its_own_words(self):
        for command, words in (
                (("render", "1", "--out", "y.png"), "there is no option --out of litags render; "),
                (("list", "--fliter", "x"), "there is no option --fliter of litags list; "),
                (("cancel", "1", "second", "third"), "litags cancel does not take: second third; "),
                (("list", "--limit", "-3"),
                 '--limit takes a whole number from 0 to 1000000, not "-3"; '),
                (("--retry", "-1", "list"), '--retry takes a number from 0 to 1000000, not "-1"; '),
                (("submit", "d", "--iterations", "x"), '--iterations takes a whole number, not "x"; '),
                (("submit", "d", "--seed", "-1"), "--seed takes a whole number from 0 on, "),
                (("submit", "d", "--refine-cameras=x"), "--refine-cameras takes true or false; "),
                (("render", "1"), "--output is not given; "),
                (("submit", "d", "--max-memory", "1lb"), "--max-memory takes a number of bytes, "),
                (("clone", "1", "--max-run-seconds", "nan"),
                 '--max-run-seconds takes a number from 0 on, not "nan"; '),
                (("update", "1", "--keep-seconds", "inf"),
                 '--keep-seconds takes a number from 0 on, not "inf"; ')):
            with self.subTest(command):
                _, err = self.litags(*command, exit_code=2)
                self.assertIn(words, err)
                self.assertTrue(err.endswith("--help says what there is\n"), err)

    def test_a_command_that_is_not_there_is_answered_with_those_that_are(self):
        for words, said in ((("help",), 'there is no command "help"'), ((), "no command is given")):
            _, err = self.litags(*words, exit_code=2)
            self.assertIn(said + "; choose one of: submit watch ", err)

    def test_bad_usage_of_every_program_ends_with_2(self):
        for program in (harness.SERVER_PROGRAM, harness.SERVER_PROGRAM.replace("server", "worker")):
            for word in ("--frobnicate", "--threads=many"):
                done = subprocess.run([os.path.join(harness.BIN, program), word],
                                      stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                self.assertEqual(done.returncode, 2, (program, word, done.stderr))


if __name__ == "__main__":
    unittest.main(verbosity=2)
