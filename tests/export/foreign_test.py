"""Programs of others read what the export writes, and draw the same from it.

They come from npm, by the lock file beside this one; without npm or a registry the test is skipped.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import npm_packages  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
BIN = pathlib.Path(os.environ["LITAGS_BIN"])
BENCH, SAMPLE, TRAIN = (BIN / f"litags-{name}" for name in ("bench", "sample", "train"))
WORK = pathlib.Path(os.environ["LITAGS_NPM_FOLDER"])

# Largest error of positions (scene units), colours and opacities (of 1) of what others read: half a
# step of the format's numbers in the made-up scene, which is some 10 units large.
LIMITS = {
    "ply": (1e-6, 1e-6, 1e-6),
    "compressed-ply": (5e-3, 2.5e-3, 2.5e-3),
    "splat": (1e-6, 2.5e-3, 2.5e-3),
    "spz": (1.3e-4, 4e-3, 2.5e-3),
    "spz-v4": (1.3e-4, 4e-3, 2.5e-3),
    "sog": (1e-3, 1e-2, 2.5e-3),
    "glb": (1e-6, 1e-6, 1e-5),
    "usda": (1e-6, 1e-5, 1e-5),
}
SH0 = 0.28209479177387814


def read_ply(path):
    """Columns of a binary .ply of floats."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names = re.findall(r"property float (\w+)", data[:end].decode())
    table = numpy.frombuffer(data[end:], "<f4").reshape(-1, len(names))
    return {name: table[:, k].astype(float) for k, name in enumerate(names)}


XYZ, RGB = ("x", "y", "z"), ("red", "green", "blue")


def read_surface(path):
    """Vertices and triangles, if any, of a binary .ply of these."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode()
    counts = [int(count) for count in re.findall(r"element \w+ (\d+)", header)]
    types = {"float": "<f4", "double": "<f8", "uchar": "u1"}
    vertex = numpy.dtype([(name, types[kind]) for kind, name in
                          re.findall(r"property (\w+) (\w+)\n", header)])
    table = numpy.frombuffer(data, vertex, counts[0], end)
    corners = numpy.dtype([("count", "u1"), ("corners", "<i4", 3)])
    faces = numpy.frombuffer(data, corners, *counts[1:], end + table.nbytes) if counts[1:] else None
    return table, None if faces is None else faces["corners"].tolist()


def columns(table, names):
    return numpy.stack([table[name].astype(float) for name in names], 1)


def linear(code):
    """Linear light of sRGB codes."""
    value = code / 255
    return numpy.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def positions(ply):
    return numpy.stack([ply[axis] for axis in "xyz"], 1)


def colors(ply):
    return numpy.stack([0.5 + SH0 * ply[f"f_dc_{c}"] for c in range(3)], 1)


def opacities(ply):
    return 1 / (1 + numpy.exp(-ply["opacity"]))


class ForeignTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        report = WORK / "report.json"
        run = subprocess.run(
            [BENCH, "export", "--gaussians", "1500", "--views", "2", "--converter",
             WORK / "convert.mjs", "--json", report, "--out", WORK / "files"],
            capture_output=True, text=True, timeout=250)
        assert run.returncode == 0, run.stdout + run.stderr
        cls.rows = {row["format"]: row for row in json.loads(report.read_text())["formats"]}
        cls.wanted = read_ply(WORK / "files/ply.ply")

    def test_others_find_the_same_gaussians(self):
        for name, (far, color, opacity) in LIMITS.items():
            with self.subTest(name):
                wanted, found = self.wanted, read_ply(WORK / f"files/{name}.by-others.ply")
                at, want = positions(found), positions(wanted)
                self.assertEqual(len(at), len(want))
                if name in ("splat", "compressed-ply"):  # by visibility, by place
                    nearest = [numpy.argmin(((at - p) ** 2).sum(1)) for p in want]
                    self.assertEqual(len(set(nearest)), len(want))
                    at = at[nearest]
                    found = {key: values[nearest] for key, values in found.items()}
                for bound in (numpy.min, numpy.max):
                    self.assertLessEqual(abs(bound(at, 0) - bound(want, 0)).max(), far)
                self.assertLessEqual(abs(at - want).max(), far)
                # Colours beyond what bytes hold are cut off; nobody sees them.
                cut = [numpy.clip(colors(ply), 0, 1) for ply in (found, wanted)]
                self.assertLessEqual(abs(cut[0] - cut[1]).max(), color)
                self.assertLessEqual(abs(opacities(found) - opacities(wanted)).max(), opacity)

    def test_others_draw_what_we_draw(self):
        for name in LIMITS:
            with self.subTest(name):
                ours, others = self.rows[name]["psnr_db"], self.rows[name]["psnr_of_others_db"]
                # Both above 60 dB: they differ by rounding only.
                self.assertAlmostEqual(min(ours, 60), min(others, 60), delta=1.0)

    def test_formats_without_a_reader_are_not_read(self):
        self.assertNotIn("psnr_of_others_db", self.rows["colmap"])


class SurfaceTest(unittest.TestCase):
    """Points and triangles of a sample capture."""

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            room, files = pathlib.Path(folder, "room"), pathlib.Path(folder, "files")
            cls.run_(SAMPLE, room, "--size", "180x136", "--views", "12", "--truth")
            cls.run_(TRAIN, room, "--light", "high", "--iterations", "200", "-o", room / "run")
            cls.run_(BENCH, "geometry", room / "run/scene.litags", room / "depth", "--out", files)
            cls.ours = {kind: read_surface(files / f"scene.{kind}.ply")
                        for kind in ("points", "mesh")}
            cls.found = {}
            for name in ("scene.points.ply", "scene.las", "scene.mesh.ply", "scene.mesh.glb"):
                cls.run_(WORK / "convert.mjs", files / name, files / "by-others.ply")
                cls.found[name] = read_surface(files / "by-others.ply")

    @staticmethod
    def run_(*command):
        run = subprocess.run(command, capture_output=True, text=True, timeout=250)
        assert run.returncode == 0, run.stdout + run.stderr

    def compare(self, name, far, of_codes, color):
        """Others find our vertices within `far`, colours within `color` of `of_codes` of ours."""
        ours, triangles = self.ours["mesh" if "mesh" in name else "points"]
        found, found_triangles = self.found[name]
        self.assertGreater(len(ours), 1000)
        self.assertEqual(found_triangles, triangles)
        self.assertLess(abs(columns(ours, XYZ) - columns(found, XYZ)).max(), far)
        wanted = of_codes(columns(ours, RGB))
        self.assertLess(abs(wanted - columns(found, RGB)).max(), color)
        self.assertGreater(wanted.std(), 10 * color)  # colours there are

    def test_three_js_reads_points_and_meshes(self):
        self.compare("scene.points.ply", 1e-5, linear, 1 / 255)
        self.compare("scene.mesh.ply", 1e-5, linear, 1 / 255)

    def test_loaders_gl_reads_las(self):
        self.compare("scene.las", 1e-7, lambda codes: codes, 0.5)

    def test_gltf_transform_reads_meshes(self):
        self.compare("scene.mesh.glb", 1e-5, linear, 1e-4)


if __name__ == "__main__":
    npm_packages.install_or_skip(HERE, WORK, extra=[path.name for path in HERE.glob("*.mjs")])
    unittest.main()
