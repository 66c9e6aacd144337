"""The package of client/python as a program uses it, and its example, over connections that break.

The package is installed into a scratch folder; this script runs again with the Python there.
"""

import contextlib
import importlib.metadata
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

SOURCE = pathlib.Path(__file__).resolve().parents[2]
INSTALLED = "LITAGS_PYTHON_PACKAGE"

if INSTALLED not in os.environ:
    sys.path.insert(0, str(SOURCE / "tests/support"))
    import python_package
    if why := python_package.missing():
        print("skipped:", why)
        sys.exit(python_package.SKIPPED)
    with tempfile.TemporaryDirectory(prefix="litags-python-") as work:
        python = python_package.install(work)
        # The stubs of other tests would stand before those of the package.
        environment = dict(os.environ, LITAGS_STUBS=work, no_grpc_proxy="127.0.0.1")
        environment[INSTALLED] = python
        sys.exit(subprocess.run([python, "-B", *sys.argv], env=environment).returncode)

import grpc  # noqa: E402
import harness  # noqa: E402
import litags  # noqa: E402
import litags.files  # noqa: E402
from litags.v1 import job_pb2  # noqa: E402


class Package(harness.ServiceTest):

    def client(self, address=None, **options):
        client = litags.Client(address or self.server.address, **options)
        self.addCleanup(client.close)
        return client

    def proxy(self, **options):
        proxy = harness.CuttableProxy(self.server.port, **options)
        self.addCleanup(proxy.close)
        return proxy

    def assert_error(self, error, code, reason, field):
        self.assertEqual((error.code, error.reason, error.field), (code, reason, field), error)

    def test_it_is_the_installed_one_and_says_its_types(self):
        folder = pathlib.Path(litags.__file__).parent
        self.assertIn("site-packages", folder.parts)
        self.assertTrue((folder / "py.typed").exists())
        self.assertTrue((folder / "v1/job_pb2.pyi").exists())
        project = (SOURCE / "CMakeLists.txt").read_text()
        self.assertEqual(importlib.metadata.version("litags"),
                         re.search(r"project\(litags VERSION ([0-9.]+)", project)[1])

    def test_files_have_the_endings_of_the_service(self):
        limits = (SOURCE / "proto/litags/v1/limits.h").read_text()
        for name, known in (("kPhotoEndings", litags.files.PHOTO_ENDINGS),
                            ("kVideoEndings", litags.files.VIDEO_ENDINGS),
                            ("kArchiveEndings", litags.files.ARCHIVE_ENDINGS)):
            endings = re.search(name + r" = \{(.*?)\}", limits, re.DOTALL)[1]
            self.assertEqual(set(known), set(re.findall(r'"(.*?)"', endings)), name)

    def test_photos_of_one_name_do_not_replace_each_other(self):
        folders = [self.photos(("a.png", "b.png")), self.photos(("a.png",))]
        paths = [os.path.join(f, name) for f in folders for name in os.listdir(f)]
        with self.assertRaisesRegex(ValueError, "two photos are called a.png"):
            litags.files.find_photos(paths)

    def test_submit_watch_over_cuts_render_and_export(self):
        proxy = self.proxy()
        client = self.client(proxy.address)
        folder = self.photos(("slow.png", "b.png", "c.png"))
        job = client.submit(folder, options={"iterations": 100, "preview_every": 5},
                            labels={"site": "north"}, title="a room")
        numbers = []
        for event in client.watch(job):
            numbers.append(event.number)
            if len(numbers) in (3, 6):
                proxy.cut()
        done = client.wait(job, progress=False)
        self.assertGreaterEqual(proxy.connections, 3)
        self.assertEqual(numbers, list(range(1, done.last_event + 1)))
        self.assertEqual((dict(done.labels), done.display_name), ({"site": "north"}, "a room"))
        self.assertEqual(client.cameras(job), ["b.png", "c.png", "slow.png"])

        picture = client.render(job, "b.png", width=32, channel="CHANNEL_ORIGINAL")
        self.assertEqual(harness.png_size(picture), (32, 24))
        scene = pathlib.Path(self.folder, "scene.ply")
        client.export(job, scene)
        self.assertTrue(scene.read_bytes().startswith(b"ply\n"))
        with self.assertRaises(litags.LitagsError) as caught:
            client.export(job, scene, format="MODEL_FORMAT_PLY", light=9)
        self.assert_error(caught.exception, grpc.StatusCode.INVALID_ARGUMENT, "LIGHT_INVALID",
                          "light")
        self.assertTrue(scene.read_bytes().startswith(b"ply\n"))  # as it was
        self.assertEqual([path.name for path in pathlib.Path(self.folder).glob("*.part")], [])

    def test_a_list_of_photos_and_known_cameras(self):
        folder = pathlib.Path(self.photos())
        cameras = pathlib.Path(self.folder, "transforms.json")
        cameras.write_text("{}")
        client = self.client()
        before = len(self.jobs.ListJobs(harness.rpc.ListJobsRequest()).jobs)
        with self.assertRaises(litags.LitagsError) as caught:
            client.submit([folder / "a.png", folder / "b.png", folder / "c.png"], cameras=cameras)
        self.assertRegex(caught.exception.field, r"cameras\[transforms.json\]")
        with self.assertRaises(litags.LitagsError) as caught:
            client.submit([folder / "a.png"])
        self.assertEqual(caught.exception.reason, "TOO_FEW_PHOTOS")
        self.assertEqual(len(self.jobs.ListJobs(harness.rpc.ListJobsRequest()).jobs), before)
        with self.assertRaisesRegex(ValueError, "holds no photos"):
            client.submit(tempfile.mkdtemp(dir=self.folder))

    def test_bundlers_cameras_take_their_list_of_photos_along(self):
        folder = pathlib.Path(self.photos())
        cameras = pathlib.Path(self.folder, "bundle.out")
        cameras.write_text("# Bundle file v0.3\n1 0\n60 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n")
        client = self.client()
        with self.assertRaises(litags.LitagsError) as caught:
            client.submit(folder, cameras=cameras)
        self.assertEqual(caught.exception.reason, "BAD_BUNDLE")
        cameras.with_name("list.txt").write_text("a.png\n")
        job = client.submit(folder, cameras=cameras, options={"iterations": 10})
        sizes = {file.name: file.size_bytes for file in self.jobs.ListFiles(
            harness.rpc.ListFilesRequest(name=job)).files}
        self.assertEqual(sizes["bundle.out"], cameras.stat().st_size + len("\na.png\n"))

    def test_an_archive_with_masks_and_a_video(self):
        folder = self.photos()
        masks = pathlib.Path(self.folder, "covers")
        masks.mkdir()
        (masks / "a.png").write_bytes(harness.png(seed=4))
        archive = shutil.make_archive(os.path.join(self.folder, "night"), "zip", folder)
        client = self.client()
        job = client.submit(archive, masks=masks, options={"iterations": 5})
        client.wait(job, progress=False)
        self.assertEqual(self.roles(job), {
            "ARCHIVE": ["night.zip"], "PHOTO": ["a.png", "b.png", "c.png"], "MASK": ["a.png"]})
        video = os.path.join(self.folder, "walk.MP4")
        self.litags("path", job, "--orbit", "--frames", "12", "--size", "64x48", "--video", video)
        job = client.submit(video, options={"frames": 8, "iterations": 5})
        self.assertEqual(self.roles(job), {"VIDEO": ["walk.MP4"]})

    def roles(self, job):
        """Names of the job's files by what they are for."""
        names = {}
        for file in self.jobs.ListFiles(harness.rpc.ListFilesRequest(name=job)).files:
            role = harness.rpc.FileRole.Name(file.role).removeprefix("FILE_ROLE_")
            names.setdefault(role, []).append(file.name)
        return {role: sorted(found) for role, found in names.items()}

    def test_a_name_that_is_not_utf8_is_named_before_there_is_a_job(self):
        folder = self.photos()
        pathlib.Path(os.fsdecode(os.path.join(os.fsencode(folder), b"caf\xe9.png"))).write_bytes(
            harness.png(seed=9))
        before = self.litags("list", "--json")[0]
        with self.assertRaisesRegex(ValueError, r"caf\\xe9.png': the file's name is not UTF-8"):
            self.client().submit(folder)
        self.assertEqual(self.litags("list", "--json")[0], before)

    def test_a_server_that_never_answered_is_reported_at_once(self):
        with self.assertRaises(litags.LitagsError) as caught:
            self.client("127.0.0.1:1").submit(self.photos())
        self.assertEqual(caught.exception.code, grpc.StatusCode.UNAVAILABLE)

    def test_a_server_that_vanished_is_waited_for_no_longer_than_said(self):
        server = harness.Server(self.folder)
        client = self.client(server.address, retry_seconds=1)
        job = client.submit(self.photos())
        server.kill()
        with self.assertRaises(litags.LitagsError) as caught:
            client.job(job)
        self.assertEqual(caught.exception.code, grpc.StatusCode.UNAVAILABLE)

    def test_progress_is_a_bar_where_tqdm_is_installed(self):
        client = self.client()
        job = client.submit(self.photos(), options={"iterations": 40})
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            with mock.patch.dict(sys.modules, {"tqdm": None}):
                self.assertEqual(client.wait(job).state, job_pb2.JOB_STATE_SUCCEEDED)
        self.assertEqual(said.getvalue(), "")
        bars = []

        class Bar:
            def __init__(self, desc, unit):
                self.n, self.total = 0, None
                bars.append(self)

            def __enter__(self):
                return self

            def __exit__(self, *_):
                pass

            def set_postfix_str(self, text, refresh):
                pass

            def update(self, more):
                self.n += more

        with mock.patch.dict(sys.modules, {"tqdm": mock.Mock(tqdm=Bar)}):
            client.wait(job)
        self.assertEqual([(bar.n, bar.total) for bar in bars], [(40, 40)])
        try:
            import tqdm  # noqa: F401
        except ImportError:
            return
        with contextlib.redirect_stderr(said):
            client.wait(job)
        self.assertIn(f"{job}: 100%", said.getvalue())

    # reconstruct.py, as its reader would run it.

    def start(self, photos, address, *more):
        return subprocess.Popen(
            [sys.executable, "-B", SOURCE / "client/python/reconstruct.py", photos,
             os.path.join(self.folder, "view.png"), os.path.join(self.folder, "scene.ply"),
             "--server", address, *more],
            env=dict(os.environ, PYTHONUNBUFFERED="1"), stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True)

    def finish(self, process):
        try:
            return process.communicate(timeout=harness.PATIENCE_S)
        finally:
            process.kill()

    def test_the_example_goes_on_though_uploads_and_watches_are_cut(self):
        photos = self.photos(())
        for seed, name in enumerate(("slow.png", "b.png", "c.png")):
            pathlib.Path(photos, name).write_bytes(harness.large_png(seed))
        proxy = self.proxy(cut_every=2 << 20)
        process = self.start(photos, proxy.address, "--iterations", "100")
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "JOB_STATE_RUNNING" in line:
                proxy.cut()
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 0, err)
        self.assertGreaterEqual(proxy.connections, 3)
        # No event twice: a run changes its state three times at most.
        self.assertEqual(sum("JOB_STATE_RUNNING" in line for line in lines), 1, lines)
        self.assertIn("b.png in normal light", lines[-1])
        picture = pathlib.Path(self.folder, "view.png").read_bytes()
        self.assertEqual(harness.png_size(picture), (64, 48))  # the fake engine's
        self.assertTrue(pathlib.Path(self.folder, "scene.ply").read_bytes().startswith(b"ply\n"))

    def test_the_example_says_what_is_refused_with_its_reason_and_field(self):
        process = self.start(self.photos(("a.png",)), self.server.address, "--iterations", "-1")
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1)
        self.assertRegex(err, r"INVALID_ARGUMENT \w+, field options.iterations")

    def test_the_example_finds_its_server_in_the_environment(self):
        done = subprocess.run(
            [sys.executable, "-B", SOURCE / "client/python/reconstruct.py", self.photos(),
             os.path.join(self.folder, "view.png"), "--iterations", "-1"],
            env=dict(os.environ, LITAGS_SERVER=self.server.address), stderr=subprocess.PIPE,
            text=True)
        self.assertRegex(done.stderr, r"INVALID_ARGUMENT \w+, field options.iterations")

    def test_the_example_says_why_a_job_failed(self):
        process = self.start(self.photos(("fail.png", "b.png", "c.png")), self.server.address)
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 1)
        self.assertRegex(err, r"take photos that overlap more\s+\w+ SFM_TOO_FEW_VIEWS, field images")


if __name__ == "__main__":
    unittest.main(verbosity=2)
