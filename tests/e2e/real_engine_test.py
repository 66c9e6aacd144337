"""Photos to pictures with nothing faked: server, worker, COLMAP and training, on a small capture."""

import array
import ast
import json
import os
import re
import signal
import struct
import subprocess
import unittest

import harness

harness.PATIENCE_S = 400
VIEWS = 16


def read_npy(path):
    """(shape, flat array of floats) of a float32 .npy file."""
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack("<H", data[8:10])[0]
    header = ast.literal_eval(data[10:10 + length].decode())
    assert header["descr"] == "<f4" and not header["fortran_order"], header
    return header["shape"], array.array("f", data[10 + length:])


def read_ply(path):
    """(property names, rows of floats) of a binary little-endian .ply of floats."""
    with open(path, "rb") as file:
        data = file.read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().split("\n")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines[:2]
    count = int(re.search(r"element vertex (\d+)", data[:end].decode()).group(1))
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    values = array.array("f", data[end:])
    assert len(values) == count * len(names), (len(values), count, len(names))
    return names, [values[i:i + len(names)] for i in range(0, len(values), len(names))]


class RealEngine(harness.ServiceTest):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.capture = os.path.join(cls.class_folder, "capture")
        subprocess.run([os.path.join(harness.BIN, "litags-sample"), cls.capture, "--size", "200x150",
                        "--views", str(VIEWS)], check=True, stdout=subprocess.DEVNULL)

    def submit_room(self, *args):
        out, _ = self.litags("submit", os.path.join(self.capture, "low"), "--cameras",
                             os.path.join(self.capture, "transforms_train.json"), *args)
        return out.strip()

    def room(self):
        """A finished scene of the room; one for the whole class."""
        cls = type(self)
        if not hasattr(cls, "done"):
            cls.done = self.submit_room("--iterations", "300", "--holdout-every", "0", "--watch")
        return cls.done

    def mean_of(self, *args):
        path = os.path.join(self.folder, "view.npy")
        self.litags("render", self.room(), *args, "-o", path)
        shape, values = read_npy(path)
        self.assertEqual(shape[:2], (150, 200))
        self.assertTrue(all(v == v for v in values))
        return sum(values) / len(values)

    def test_dark_photos_render_normally_lit_and_as_photographed(self):
        name = json.loads(self.litags("cameras", self.room(), "--json")[0])["cameras"][0]["name"]
        lit = self.mean_of("--camera", name)
        dark = self.mean_of("--camera", name, "--channel", "original")
        between = self.mean_of("--camera", name, "--light", "0.5")
        darker = self.mean_of("--camera", name, "--light", "1.5")
        stopped_down = self.mean_of("--camera", name, "--exposure", "-2")
        # Photos have a mean of .045, targets of .49; a few hundred iterations come near to both.
        self.assertTrue(0.35 < lit < 0.6, lit)
        self.assertTrue(0.02 < dark < 0.09, dark)
        self.assertTrue(darker < dark < between < lit, (darker, between))
        self.assertTrue(dark < stopped_down < 0.75 * lit, stopped_down)

    def test_a_view_from_where_no_photo_was_taken_shows_the_room(self):
        with open(os.path.join(self.capture, "transforms_test.json")) as file:
            frame = json.load(file)["frames"][0]["transform_matrix"]
        # OpenGL camera-to-world to OpenCV world-to-camera.
        rotation = [[frame[r][c] * (1, -1, -1)[c] for c in range(3)] for r in range(3)]
        center = [frame[r][3] for r in range(3)]
        rows = [[rotation[k][r] for k in range(3)] + [-sum(rotation[k][r] * center[k] for k in range(3))]
                for r in range(3)] + [[0, 0, 0, 1]]
        pose = [repr(v) for row in rows for v in row]
        self.assertTrue(0.35 < self.mean_of("--pose", *pose) < 0.6)
        alpha = self.mean_of("--pose", *pose, "--channel", "alpha")
        self.assertGreater(alpha, 0.9)

    def test_the_exported_ply_is_what_viewers_expect(self):
        path = os.path.join(self.folder, "scene.ply")
        self.litags("export", self.room(), "-o", path)
        names, rows = read_ply(path)
        self.assertEqual(names, ["x", "y", "z", "nx", "ny", "nz"] + [f"f_dc_{i}" for i in range(3)]
                         + [f"f_rest_{i}" for i in range(45)] + ["opacity"]
                         + [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)])
        self.assertGreater(len(rows), 100)
        for row in rows:
            self.assertTrue(all(abs(v) < 1e6 for v in row))

    def test_a_killed_worker_does_not_lose_the_job(self):
        job = self.submit_room("--iterations", "800", "--checkpoint-every", "50", "--preview-every", "50")
        watch = self.start_litags("watch", job, "--json")
        for line in watch.stdout:
            if json.loads(line).get("progress", {}).get("iteration", 0) >= 150:
                break
        else:
            self.fail(f"never saw iteration 150: {watch.communicate()}")
        self.assertEqual(self.state(job), harness.RUNNING, "trained too fast to be killed")
        os.kill(self.worker_of_server(), signal.SIGKILL)
        out, err = watch.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(watch.returncode, 0, out + err)
        found = self.jobs.GetJob(harness.rpc.GetJobRequest(name=job))
        self.assertEqual((found.state, found.attempt), (harness.SUCCEEDED, 2), found)
        resumed = re.findall(r"resumed at iteration (\d+)", "\n".join(found.report.notes))
        self.assertTrue(resumed and int(resumed[0]) >= 50, found.report.notes)

    def test_a_scene_trained_further_has_the_bytes_of_one_trained_at_once(self):
        job = self.submit_room("--iterations", "40", "--watch")
        self.litags("resume", job, "--iterations", "60")
        self.litags("watch", job)
        at_once = self.submit_room("--iterations", "60", "--schedule-iterations", "40", "--watch")
        scenes = []
        for name in (job, at_once):
            path = os.path.join(self.folder, "scene.ply")
            self.litags("export", name, "-o", path, "--format", "ply-full")
            with open(path, "rb") as file:
                scenes.append(file.read())
        self.assertTrue(scenes[0] == scenes[1])
        self.assertIn("resumed at iteration 40", self.litags("show", job)[0])

    def test_photos_of_different_places_end_in_a_clear_failure(self):
        folder = os.path.join(self.folder, "strangers")
        os.mkdir(folder)
        for i in range(4):
            with open(os.path.join(folder, f"{i}.png"), "wb") as file:
                file.write(harness.large_png(i, 160, 120))
        _, err = self.litags("submit", folder, "--watch", exit_code=1)
        self.assertIn("SFM_NO_MODEL", err)
        # With cameras that somebody says they have, too.
        frames = [{"file_path": f"{i}.png", "transform_matrix":
                   [[1, 0, 0, 0.3 * i], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]} for i in range(4)]
        cameras = os.path.join(self.folder, "transforms.json")
        with open(cameras, "w") as file:
            json.dump({"camera_angle_x": 0.9, "w": 160, "h": 120, "frames": frames}, file)
        _, err = self.litags("submit", folder, "--cameras", cameras, "--watch", exit_code=1)
        self.assertIn("SFM_NO_POINTS", err)

    def test_a_video_of_a_phone_becomes_a_scene_by_one_command(self):
        capture = os.path.join(self.folder, "walk")
        subprocess.run([os.path.join(harness.BIN, "litags-sample"), capture, "--size", "200x150",
                        "--views", "24"], check=True, stdout=subprocess.DEVNULL)
        video = os.path.join(self.folder, "night.mov")
        subprocess.run([os.path.join(harness.BIN, "litags-test-video"), os.path.join(capture, "high"),
                        video], check=True)
        out, err = self.litags("submit", video, "--frames", "20", "--iterations", "40", "--watch")
        job = out.strip()
        self.assertIn("choosing frames of night.mov", err)
        # A part of the way between two of the 24 places has no frame of its own.
        self.assertRegex(self.litags("show", job)[0], r"\b(1[5-9]|20) of the 72 frames of night.mov")
        cameras = json.loads(self.litags("cameras", job, "--json")[0])["cameras"]
        self.assertEqual(cameras[0]["name"], "frame_0001.png")
        # Upright, though the sensor saw it on its side.
        picture = os.path.join(self.folder, "view.npy")
        self.litags("render", job, "--camera", "frame_0001.png", "-o", picture)
        self.assertEqual(read_npy(picture)[0][:2], (150, 200))
        # One that is none is refused while it is sent.
        with open(video, "wb") as file:
            file.write(b"no video")
        _, err = self.litags("submit", video, exit_code=2)
        self.assertIn("VIDEO_NOT_RECOGNIZED", err)

    def test_a_folder_is_inspected_without_a_server(self):
        sheet = os.path.join(self.folder, "sheet.jpg")
        for before in ((), ("--retry", "1")):
            out = subprocess.run([os.path.join(harness.BIN, "litags"), *before, "inspect",
                                  os.path.join(self.capture, "low"), "--contact-sheet", sheet],
                                 check=True, capture_output=True, text=True, env={}).stdout
            self.assertIn(f"{VIEWS} photos would be used, 0 are left out", out)
        with open(sheet, "rb") as file:
            self.assertEqual(file.read(2), b"\xff\xd8")

    def worker_of_server(self):
        children = subprocess.run(["ps", "-o", "pid=,args=", "--ppid", str(self.server.process.pid)],
                                  capture_output=True, text=True).stdout
        for line in children.splitlines():
            pid, args = line.split(None, 1)
            if "litags-worker" in args:
                return int(pid)
        self.fail("the server has no worker: " + children)


if __name__ == "__main__":
    unittest.main(verbosity=2)
