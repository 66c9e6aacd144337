"""Pictures, paths and exports over a real socket."""

import json
import os
import shutil
import signal
import struct
import subprocess
import tempfile
import unittest

import harness
from litags.v1 import model_service_pb2 as model
from litags.v1 import render_service_pb2 as render


class Pictures(harness.ServiceTest):

    def path(self, name):
        return os.path.join(self.folder, name)

    def read(self, name):
        with open(self.path(name), "rb") as file:
            return file.read()

    def test_a_view_by_camera_has_the_size_of_its_photo(self):
        self.litags("render", self.finished_job(), "--camera", "b.png", "-o", self.path("v.png"))
        self.assertEqual(harness.png_size(self.read("v.png")), (64, 48))

    def test_a_view_by_matrix_equals_the_view_by_camera(self):
        job = self.finished_job()
        cameras = json.loads(self.litags("cameras", job, "--json")[0])["cameras"]
        camera = next(c for c in cameras if c["name"] == "b.png")["camera"]
        pose = self.path("pose.txt")
        with open(pose, "w") as file:
            file.write(" ".join(repr(v) for v in camera["viewmat"]["values"]))
        for args, name in ((("--pose", pose), "a.npy"),
                           (("--pose", *map(repr, camera["viewmat"]["values"])), "b.npy"),
                           (("--camera", "b.png"), "c.npy")):
            self.litags("render", job, *args, "-o", self.path(name))
        self.assertEqual(self.read("a.npy"), self.read("c.npy"))
        self.assertEqual(self.read("b.npy"), self.read("c.npy"))

    def test_a_view_by_look_at_takes_size_and_field_of_view(self):
        self.litags("render", self.finished_job(), "--look-at", "-4,-1,0", "0,0,0", "--up", "0,-1,0",
                    "--size", "80x50", "--fov", "40", "-o", self.path("v.png"))
        self.assertEqual(harness.png_size(self.read("v.png")), (80, 50))

    def test_every_channel_can_be_had_as_floats(self):
        planes = {"color": 3, "original": 3, "light": 3, "depth": 1, "structure": 1,
                  "illumination": 3, "noise": 3, "alpha": 1}
        for channel, count in planes.items():
            with self.subTest(channel):
                self.litags("render", self.finished_job(), "--camera", "a.png", "--channel", channel,
                            "--size", "8x6", "-o", self.path("v.npy"))
                data = self.read("v.npy")
                length = 10 + struct.unpack("<H", data[8:10])[0]
                self.assertIn(f"(6, 8, {count})".encode(), data[:length])
                self.assertEqual(len(data) - length, 4 * 6 * 8 * count)

    def test_a_jpeg_is_a_jpeg(self):
        self.litags("render", self.finished_job(), "--camera", "a.png", "-o", self.path("v.jpg"))
        self.assertEqual(self.read("v.jpg")[:2], b"\xff\xd8")
        self.assertEqual(self.read("v.jpg")[-2:], b"\xff\xd9")

    def test_an_orbit_arrives_frame_by_frame(self):
        self.litags("path", self.finished_job(), "--orbit", "--frames", "7", "--size", "16x12", "-o",
                    self.path("frames"))
        self.assertEqual(sorted(os.listdir(self.path("frames"))),
                         [f"frame_{i:04d}.png" for i in range(7)])
        self.assertEqual(harness.png_size(self.read("frames/frame_0006.png")), (16, 12))

    def test_frames_of_a_longer_path_are_not_mixed_with_those_of_a_shorter(self):
        path = ("path", self.finished_job(), "--orbit", "--size", "16x12", "-o", self.path("mixed"))
        self.litags(*path, "--frames", "5")
        _, err = self.litags(*path, "--frames", "3", exit_code=2)
        self.assertRegex(err, r"frame_000[34].png is of an earlier path.*remove")
        self.assertIn("OUTPUT_HAS_FRAMES", err)
        self.litags(*path, "--frames", "3", "--format", "jpg")
        self.litags(*path, "--frames", "5")
        self.assertEqual(len(os.listdir(self.path("mixed"))), 8)

    def test_positions_of_cameras_are_written_to_ten_digits(self):
        job = self.finished_job()
        lines = self.litags("cameras", job)[0].splitlines()[1:-1]
        cameras = json.loads(self.litags("cameras", job, "--json")[0])["cameras"]
        self.assertEqual(len(lines), len(cameras))
        for line, camera in zip(lines, cameras):
            m = camera["camera"]["viewmat"]["values"]
            position = [-sum(m[4 * r + c] * m[4 * r + 3] for r in range(3)) for c in range(3)]
            for text, value in zip(line.split()[-1].split(","), position, strict=True):
                self.assertAlmostEqual(float(text), value, places=8)

    def new_folder(self):
        """With nothing in it."""
        return tempfile.mkdtemp(dir=self.folder)

    def test_a_path_as_a_video(self):
        self.finished_job()
        self.folder = self.new_folder()
        for name, head in (("v.webm", b"\x1a\x45\xdf\xa3"), ("v.mp4", b"ftyp")):
            _, err = self.litags("path", self.finished_job(), "--orbit", "--frames", "7", "--size",
                                 "32x24", "--video", self.path(name), "--fps", "20")
            self.assertIn("7 frames, 20 a second", err)
            self.assertIn(head, self.read(name)[:12])
        self.assertEqual(sorted(os.listdir(self.folder)), ["v.mp4", "v.webm"])

    def test_a_path_as_a_video_and_files(self):
        self.litags("path", self.finished_job(), "--orbit", "--frames", "3", "--size", "32x24",
                    "--format", "jpeg", "--video", self.path("v.webm"), "-o", self.path("frames"))
        self.assertEqual(sorted(os.listdir(self.path("frames"))),
                         [f"frame_{i:04d}.jpeg" for i in range(3)])
        self.assertGreater(len(self.read("v.webm")), 100)

    def test_videos_that_cannot_be_written(self):
        orbit = ("path", self.finished_job(), "--orbit", "--frames", "3")
        self.folder = self.new_folder()
        for flags, reason in (((), "OUTPUT_MISSING"),
                              (("--video", "v.avi"), "VIDEO_FORMAT_UNKNOWN"),
                              (("--video", "none/v.webm"), "OUTPUT_NOT_WRITABLE"),
                              (("--video", "v.webm", "--format", "npy"), "PICTURE_FORMAT_UNKNOWN"),
                              (("--video", "v.webm", "--size", "1x1"), "VIDEO_SIZE_INVALID"),
                              (("--video", "v.webm", "--fps", "0"), "1 to 120"),
                              (("--fps", "5", "-o", "frames"), "--video")):
            with self.subTest(flags):
                at = [self.path(flag) if "v." in flag or flag == "frames" else flag for flag in flags]
                _, err = self.litags(*orbit, *at, exit_code=2)
                self.assertIn(reason, err)
                self.assertLessEqual(err.count("error:"), 1, err)
        self.assertEqual(os.listdir(self.folder), [])

    def test_a_video_whose_program_is_not_there(self):
        self.folder = self.new_folder()
        alone = shutil.copy(os.path.join(harness.BIN, "litags"), self.path("litags"))
        environment = dict(os.environ, LITAGS_SERVER=self.server.address, PATH=self.folder)
        told = subprocess.run([alone, "path", "jobs/1", "--orbit", "--video", self.path("v.webm")],
                              env=environment, stderr=subprocess.PIPE, text=True,
                              timeout=harness.PATIENCE_S)
        self.assertEqual(told.returncode, 2, told.stderr)
        self.assertIn("VIDEO_PROGRAM_MISSING", told.stderr)
        self.assertEqual(os.listdir(self.folder), ["litags"])

    def test_a_path_that_is_refused_leaves_no_folder(self):
        self.finished_job()
        self.folder = self.new_folder()
        for flags, reason in ((("--light-from", "1", "--light-to", "9"), "LIGHT_INVALID"),
                              (("--frames", "0"), "1 to 10000"),
                              (("--frames", "-1"), "1 to 10000")):
            with self.subTest(flags):
                _, err = self.litags("path", self.finished_job(), "--orbit", *flags, "-o",
                                     self.path("frames"), exit_code=2)
                self.assertIn(reason, err)
        self.assertEqual(os.listdir(self.folder), [])

    def test_a_video_of_a_path_that_is_broken_off_is_not_left(self):
        job = self.finished_job()
        self.folder = self.new_folder()
        process = self.start_litags("path", job, "--orbit", "--frames", "5000", "--size",
                                    "64x48", "--video", self.path("v.webm"))
        self.wait_for(lambda: os.listdir(self.folder), "a beginning")
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual((process.returncode, err), (130, "interrupted\n"))
        self.assertEqual(os.listdir(self.folder), [])

    def test_a_video_is_not_left_whose_program_is_killed(self):
        job = self.finished_job()
        self.folder = self.new_folder()
        process = self.start_litags("path", job, "--orbit", "--frames", "5000", "--size",
                                    "64x48", "--video", self.path("v.webm"))

        def film():
            with open(f"/proc/{process.pid}/task/{process.pid}/children") as file:
                return file.read().split()

        self.wait_for(lambda: film() and os.listdir(self.folder), "a beginning")
        os.kill(int(film()[0]), signal.SIGKILL)  # as Ctrl-C of a terminal ends both
        _, err = process.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(process.returncode, 2)
        self.assertIn("VIDEO_FAILED", err)
        self.assertEqual(os.listdir(self.folder), [])

    def test_a_path_through_cameras_begins_and_ends_at_them(self):
        job = self.finished_job()
        self.litags("path", job, "--keyframes", "a.png", "c.png", "--frames", "5", "--format", "raw",
                    "-o", self.path("frames"))
        self.litags("render", job, "--camera", "a.png", "-o", self.path("a.raw"))
        first = struct.unpack("<16f", self.read("frames/frame_0000.raw")[:64])
        # Interpolated rotations are orthonormal to rounding only.
        for got, want in zip(first, struct.unpack("<16f", self.read("a.raw")[:64])):
            self.assertAlmostEqual(got, want, places=5)

    def test_a_job_that_still_trains_can_be_rendered(self):
        job = self.submit("--iterations", "100000", "--preview-every", "5", names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.jobs.GetJob(harness.rpc.GetJobRequest(name=job))
                      .HasField("snapshot_iteration"), "a snapshot")
        _, err = self.litags("render", job, "--camera", "b.png", "-o", self.path("v.png"))
        self.assertEqual(self.state(job), harness.RUNNING)
        self.assertRegex(err, r"iteration \d+")
        self.litags("cancel", job)

    def test_an_export_is_the_bytes_that_the_service_announces(self):
        job = self.finished_job()
        for flags, wanted in (((), model.MODEL_FORMAT_PLY),
                              (("--format", "ply-full"), model.MODEL_FORMAT_PLY_FULL)):
            with self.subTest(flags):
                self.litags("export", job, "-o", self.path("scene.ply"), *flags)
                parts = list(self.models.ExportModel(
                    model.ExportModelRequest(name=job, format=wanted)))
                data = b"".join(part.chunk for part in parts[1:])
                self.assertEqual(parts[0].header.size_bytes, len(data))
                self.assertGreater(len(parts), 2)
                self.assertEqual(self.read("scene.ply"), data)
                self.assertEqual([name for name in os.listdir(self.folder)
                                  if name.startswith("scene")], ["scene.ply"])

    def test_an_exports_ending_or_format_says_what_it_is(self):
        job = self.finished_job()
        request = model.ExportModelRequest(name=job, format=model.MODEL_FORMAT_SPZ)
        options = model.ExportModelRequest(
            name=job, format=model.MODEL_FORMAT_SPZ_V4, exposure_stops=-1.5,
            up=model.UP_AXIS_NEGATIVE_Y, scale=0.5, max_splats=3, antialiased=True)
        options.crop.min.x, options.crop.max.z = -1, 2.5
        for flags, wanted in (
                (("-o", self.path("scene.spz")), request),
                (("-o", self.path("scene.spz"), "--format", "spz-v4", "--exposure", "-1.5",
                  "--up=-y", "--scale", "0.5", "--max-splats", "3", "--antialiased",
                  "--crop", "-1,0,0", "0,0,2.5"), options)):
            with self.subTest(flags):
                self.litags("export", job, *flags)
                parts = list(self.models.ExportModel(wanted))
                self.assertEqual(self.read("scene.spz"), b"".join(part.chunk for part in parts[1:]))

    def test_light_and_exposure_reach_the_picture(self):
        job = self.finished_job()

        def first_value(*args):
            self.litags("render", job, "--camera", "a.png", *args, "-o", self.path("v.raw"))
            return struct.unpack("<f", self.read("v.raw")[:4])[0]

        # The fake scene adds .01 t and .02 stops to its values.
        lit = first_value("--light", "0")
        self.assertAlmostEqual(first_value("--light", "0.5") - lit, 0.005, places=5)
        self.assertAlmostEqual(first_value("--light", "-1.5") - lit, -0.015, places=5)
        self.assertAlmostEqual(first_value("--light", "0", "--exposure", "+1.5") - lit, 0.03, places=5)
        normal = first_value()
        self.assertAlmostEqual(first_value("--exposure", "-2") - normal, -0.04, places=5)

    def test_a_path_slides_light_and_exposure(self):
        self.litags("path", self.finished_job(), "--keyframes", "a.png", "a.png", "--light-from", "1",
                    "--light-to", "-1", "--exposure-from", "0", "--exposure-to", "-3", "--frames", "5",
                    "--format", "raw", "-o", self.path("frames"))
        values = [struct.unpack("<f", self.read(f"frames/frame_{i:04d}.raw")[:4])[0] for i in range(5)]
        for i in range(5):
            self.assertAlmostEqual(values[i] - values[0], -0.005 * i - 0.015 * i, places=5)

    def test_an_export_has_the_light_asked_for(self):
        self.litags("export", self.finished_job(), "-o", self.path("dusk.ply"), "--light", "0.5")
        self.assertTrue(self.read("dusk.ply").startswith(b"ply\ncomment light 0.5\n"))

    def test_python_slides_the_light_along_an_orbit(self):
        frames = list(self.pictures.RenderPath(render.RenderPathRequest(
            name=self.finished_job(), orbit=render.Orbit(), frames=3,
            light=render.Ramp(first=1, last=0))))
        self.assertEqual([frame.view.light for frame in frames], [1, 0.5, 0])
        for bad in (render.Ramp(first=5), render.Ramp(last=float("nan"))):
            with self.assertRaises(harness.grpc.RpcError) as caught:
                list(self.pictures.RenderPath(render.RenderPathRequest(
                    name=self.finished_job(), orbit=render.Orbit(), light=bad)))
            self.assertEqual(caught.exception.code(), harness.grpc.StatusCode.INVALID_ARGUMENT)
            self.assertEqual(harness.error_detail(caught.exception).reason, "LIGHT_INVALID")

    def test_bad_lights_are_refused_with_what_to_do(self):
        job = self.finished_job()
        where = ("--camera", "a.png", "-o", self.path("v.png"))
        for args, words in ((("render", job, "--light", "4.5", *where), "LIGHT_INVALID"),
                            (("render", job, "--light", "nan", *where), "LIGHT_INVALID"),
                            (("render", job, "--exposure", "11", *where), "EXPOSURE_INVALID"),
                            (("render", job, "--light", "1", "--channel", "depth", *where),
                             "LIGHT_INVALID"),
                            (("render", job, "--channel", "exposure", *where), "--light T"),
                            (("path", job, "--orbit", "--light-from", "1", "-o", self.path("f")),
                             "--light-to"),
                            (("path", job, "--orbit", "--light-from", "1", "--light-to", "9", "-o",
                              self.path("f")), "LIGHT_INVALID"),
                            (("export", job, "-o", self.path("s.ply"), "--light", "-5"),
                             "LIGHT_INVALID"),
                            (("export", job, "-o", self.path("s.ply"), "--light", "1", "--format",
                              "ply-full"), "LIGHT_INVALID")):
            with self.subTest(args):
                _, err = self.litags(*args, exit_code=2)
                self.assertIn(words, err)
        self.assertFalse(os.path.exists(self.path("s.ply")))

    def test_only_what_is_no_colour_has_a_range_of_values(self):
        for flags, ranged in ((("--light", "0.5"), False), (("--channel", "original"), False),
                              (("--channel", "depth"), True)):
            with self.subTest(flags):
                _, err = self.litags("render", self.finished_job(), "--camera", "a.png", *flags,
                                     "-o", self.path("v.png"))
                self.assertEqual("values" in err, ranged, err)

    def test_python_renders_raw_floats(self):
        view = self.pictures.RenderView(render.RenderViewRequest(
            name=self.finished_job(), pose=render.Pose(camera="a.png"),
            settings=render.RenderSettings(format=render.PICTURE_FORMAT_RAW_FLOAT)))
        self.assertEqual(len(view.data), 4 * view.width * view.height * view.planes)

    def test_a_folder_that_is_not_there_is_said_before_it_is_written_to(self):
        _, err = self.litags("render", self.finished_job(), "--camera", "a.png", "-o",
                             self.path("none/v.png"), exit_code=2)
        self.assertIn("OUTPUT_NOT_WRITABLE", err)
        _, err = self.litags("export", self.finished_job(), "-o", self.path("none/s.ply"),
                             exit_code=2)
        self.assertIn("field:  -o\n", err)
        # Before the server is asked, which knows no such job.
        _, err = self.litags("export", "0000", "-o", self.path("none/s.mesh.ply"), exit_code=2)
        self.assertIn("OUTPUT_NOT_WRITABLE", err)


if __name__ == "__main__":
    unittest.main(verbosity=2)
