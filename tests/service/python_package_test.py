"""The package of client/python as a program uses it, and its example, over connections that break.

Its single calls have tests in python_calls_test.py.
"""

import contextlib
import importlib.metadata
import io
import os
import pathlib
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import unittest
from concurrent import futures
from unittest import mock

SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tests/support"))
import python_package  # noqa: E402

python_package.run_installed()

import examples  # noqa: E402
import grpc  # noqa: E402
import harness  # noqa: E402
import litags  # noqa: E402
import litags.connection  # noqa: E402
import litags.files  # noqa: E402
from litags.v1 import job_pb2  # noqa: E402


class Package(harness.ServiceTest):

    def client(self, address=None, **options):
        client = litags.Client(address or self.server.address, **options)
        self.addCleanup(client.close)
        return client

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
                            ("kArchiveEndings", litags.files.ARCHIVE_ENDINGS),
                            ("kDepthEndings", litags.files.DEPTH_ENDINGS)):
            endings = re.search(name + r" = \{(.*?)\}", limits, re.DOTALL)[1]
            self.assertEqual(set(known), set(re.findall(r'"(.*?)"', endings)), name)

    def test_photos_of_one_name_do_not_replace_each_other(self):
        folders = [self.photos(("a.png", "b.png")), self.photos(("a.png",))]
        paths = [os.path.join(f, name) for f in folders for name in os.listdir(f)]
        with self.assertRaisesRegex(ValueError, "two photos are called a.png"):
            litags.files.find_photos(paths)

    def test_submit_watch_over_cuts_render_and_export(self):
        proxy = self.new_proxy()
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
        sent = []
        whole = litags.files.upload_messages
        with mock.patch("litags.files.upload_messages",
                        lambda job, batch, offsets: sent.extend(batch) or whole(job, batch, offsets)), \
                self.assertRaises(litags.LitagsError):
            client.submit(folder, cameras=cameras)
        self.assertEqual([file.path.name for file in sent], ["transforms.json"])  # and no photo
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
        sizes = {file.file_name: file.size_bytes for file in self.jobs.ListFiles(
            harness.rpc.ListFilesRequest(name=job)).files}
        self.assertEqual(sizes["bundle.out"], cameras.stat().st_size + len("\na.png\n"))

    def test_bundlers_list_may_be_the_only_lst(self):
        cameras = pathlib.Path(self.folder, "bundle.out")
        cameras.write_text("# Bundle file v0.3\n")
        cameras.with_name("capture.lst").write_text("a.png\n")
        self.assertEqual(litags.files.find_cameras(cameras)[0].tail, b"\na.png\n")
        cameras.with_name("other.lst").write_text("b.png\n")
        self.assertEqual(litags.files.find_cameras(cameras)[0].tail, b"")

    def test_of_a_folder_the_cameras_are_what_litags_takes(self):
        folder = pathlib.Path(self.folder)

        def write(name, data):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)

        def found():
            return {str(file.path.relative_to(folder))
                    for file in litags.files.find_cameras(folder)}

        with self.assertRaisesRegex(ValueError, "neither a COLMAP model nor transforms.json"):
            found()
        write("colmap/sparse/0/cameras.txt", b"x")
        write("colmap/sparse/0/images.txt", b"# comment\n1 1 0 0 0 0 0 0 1 a b.png\n1.5 2.5 -1\n")
        write("colmap/sparse/1/cameras.txt", b"x")
        write("colmap/sparse/1/images.txt", b"")
        write("colmap/sparse/0/points3D.txt", b"")
        self.assertEqual(found(), {f"colmap/sparse/0/{name}.txt" for name in ("cameras", "images")})
        write("bundle.out", b"x")
        self.assertEqual(found(), {"bundle.out"})
        for number, images in enumerate((2, 5, 3)):
            write(f"sparse/{number}/cameras.bin", b"x")
            write(f"sparse/{number}/images.bin", images.to_bytes(8, "little"))
        write("sparse/1/points3D.bin", b"x")
        self.assertEqual(found(),
                         {f"sparse/1/{name}.bin" for name in ("cameras", "images", "points3D")})

    def test_of_several_cameras_of_a_folder_the_first_of_the_list_is_taken(self):
        table = (SOURCE / "tests/support/camera_layouts.txt").read_text()
        for number, line in enumerate(table.splitlines()):
            if line.startswith("#"):
                continue
            names, used, _ = line.split(" | ")
            folder = pathlib.Path(self.folder, f"layout-{number}")
            for word in names.split():
                file, link, target = word.partition(">")
                name, _, images = file.partition("=")
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                if link:
                    (folder / name).symlink_to(target)
                    continue
                images = int(images or 0)
                lines = b"1 1 0 0 0 0 0 0 1 a.png\n" * images
                head = images.to_bytes(8, "little") if name.endswith(".bin") else b""
                (folder / name).write_bytes(head + lines)
            with self.subTest(line):
                if used == "-":
                    self.assertRaises(ValueError, litags.files.find_cameras, folder)
                    continue
                found = litags.files.find_cameras(folder)[0].path
                is_file = "." in used[1:]
                self.assertEqual(found if is_file else found.parent, folder / used)

    def test_an_archive_with_masks_and_a_video(self):
        folder = self.photos()
        masks = pathlib.Path(self.folder, "covers")
        masks.mkdir()
        (masks / "a.png").write_bytes(harness.png(seed=4))
        archive = shutil.make_archive(os.path.join(self.folder, "night"), "zip", folder)
        client = self.client()
        with self.assertNoLogs("litags"):
            job = client.submit(archive, masks=masks, options={"iterations": 5})
        client.wait(job, progress=False)
        self.assertEqual(self.roles(job), {
            "ARCHIVE": ["night.zip"], "PHOTO": ["a.png", "b.png", "c.png"], "MASK": ["a.png"]})
        unnamed = pathlib.Path(self.folder, "walk.mpg")
        unnamed.touch()
        with self.assertRaisesRegex(ValueError, "rename a video to end in one of .* [.]mp4 "):
            litags.files.find_photos(unnamed)
        video = os.path.join(self.folder, "walk.MP4")
        self.litags("path", job, "--orbit", "--frames", "12", "--size", "64x48", "--video", video)
        job = client.submit(video, options={"frames": 8, "iterations": 5})
        self.assertEqual(self.roles(job), {"VIDEO": ["walk.MP4"]})

    def test_what_is_not_used_of_an_archive_is_said(self):
        folder = self.photos()
        pathlib.Path(folder, "bad.png").write_bytes(b"no photo")
        archive = shutil.make_archive(os.path.join(self.folder, "night"), "zip", folder)
        with self.assertLogs("litags", "WARNING") as said:
            self.client().submit(archive, options={"iterations": 5})
        self.assertEqual(len(said.output), 1, said.output)
        self.assertRegex(said.output[0], r"not used, of what is in the archive: bad\.png \(.+\)")

    def test_a_photo_that_vanishes_or_shrinks_before_it_is_sent_is_named(self):
        client = self.client()
        for width, change, error, words in (
                (71, os.remove, FileNotFoundError, "b.png"),
                (72, lambda path: os.truncate(path, 9), ValueError,
                 "b.png became shorter while it was sent")):
            folder = self.photos(size=(width, 48))  # which the server has not seen

            def upload(job, batch, change=change, folder=folder, whole=litags.Client._upload):
                change(os.path.join(folder, "b.png"))
                whole(client, job, batch)

            before = len(self.jobs.ListJobs(harness.rpc.ListJobsRequest()).jobs)
            with mock.patch.object(client, "_upload", upload), self.assertRaisesRegex(error, words):
                client.submit(folder)
            self.assertEqual(len(self.jobs.ListJobs(harness.rpc.ListJobsRequest()).jobs), before)

    def test_an_export_replaces_neither_links_nor_devices(self):
        job = self.finished_job()
        scene = pathlib.Path(self.folder, "scene.ply")
        link, pipe = scene.with_name("link.ply"), scene.with_name("pipe")
        link.symlink_to(scene)
        os.mkfifo(pipe)
        client = self.client()
        client.export(job, link)
        self.assertTrue(link.is_symlink())
        with futures.ThreadPoolExecutor() as pool:
            read = pool.submit(pipe.read_bytes)
            client.export(job, pipe, format="MODEL_FORMAT_PLY")
            self.assertEqual(read.result(harness.PATIENCE_S), scene.read_bytes())
        self.assertTrue(pipe.is_fifo())

    def roles(self, job):
        """Names of the job's files by what they are for."""
        names = {}
        for file in self.jobs.ListFiles(harness.rpc.ListFilesRequest(name=job)).files:
            role = harness.rpc.FileRole.Name(file.role).removeprefix("FILE_ROLE_")
            names.setdefault(role, []).append(file.file_name)
        return {role: sorted(found) for role, found in names.items()}

    def test_photos_that_cannot_be_read_are_left_out_with_their_masks(self):
        folder = self.photos(("a.png", "b.png", "c.png", "bad.png"))
        masks = self.photos(("a.png", "bad_MASK.png"))
        pathlib.Path(folder, "bad.png").write_bytes(b"no photo")
        client = self.client()
        with self.assertLogs("litags", "WARNING") as said, \
                mock.patch("litags.client._FILES_PER_STREAM", 2):
            job = client.submit(folder, masks=masks, options={"iterations": 5})
        self.assertRegex("".join(said.output), "bad.png is left out, with bad_MASK.png: ")
        self.assertEqual(self.roles(job),
                         {"PHOTO": ["a.png", "b.png", "c.png"], "MASK": ["a.png"]})
        with self.assertRaises(litags.LitagsError) as caught:
            client.submit(folder, strict=True)
        self.assertEqual(caught.exception.field, "images[bad.png]")
        pathlib.Path(folder, "a.jpg").write_bytes(b"no photo")  # of a stem whose mask stays
        with self.assertLogs("litags", "WARNING") as said:
            job = client.submit(folder, masks=masks, options={"iterations": 5})
        self.assertRegex("".join(said.output), "a.jpg is left out: ")
        self.assertEqual(self.roles(job)["MASK"], ["a.png"])

    def test_photos_that_cannot_be_sent_are_left_out_as_litags_does(self):
        folder = pathlib.Path(self.photos(("a.png", "b.png", "c.png", "two\nlines.png")))
        masks = folder / "masks"
        for path in (masks, folder / "folder.png"):
            path.mkdir()
        for name in ("a.png", "gone.png", os.fsdecode(b"caf\xe9.png")):
            (masks / name).write_bytes(harness.mask_png())
        (folder / "gone.jpg").symlink_to("nowhere")
        (folder / "damaged.jpg").symlink_to("/proc/self/mem")  # of which no byte can be read
        (folder / os.fsdecode(b"caf\xe9.jpg")).write_bytes(harness.png(seed=8))
        client = self.client()
        with self.assertLogs("litags", "WARNING") as said:
            job = client.submit(folder, request_id="broken")
        names = ["caf?.jpg", "damaged.jpg", "gone.jpg", "two?lines.png"]
        self.assertEqual(sorted(re.match(r"WARNING:litags:(.*?) is left out", line)[1]
                                for line in said.output), names)
        self.assertIn("caf?.jpg is left out, with caf?.png: ", "".join(said.output))
        self.assertEqual(self.roles(job), {"PHOTO": ["a.png", "b.png", "c.png"], "MASK": ["a.png"]})
        # To litags, which sets more fields of the request, these files are no others.
        _, err = self.litags("submit", str(folder), "--request-id", "broken", "--name", "", exit_code=2)
        self.assertIn("with another request;", err)
        before = len(self.litags("list", "--json")[0].splitlines())
        with self.assertRaisesRegex(ValueError, r"caf\\xe9.jpg': the file's name is not UTF-8"):
            client.submit(folder, strict=True)
        (masks / "a.png").unlink()
        (masks / "a.png").symlink_to("nowhere")  # without which a photo would be another one
        with self.assertRaises(FileNotFoundError), self.assertLogs("litags", "WARNING"):
            client.submit(folder)
        self.assertEqual(len(self.litags("list", "--json")[0].splitlines()), before)

    def test_masks_beside_the_photos_go_along(self):
        folder = self.photos()
        masks = pathlib.Path(folder, "masks")
        masks.mkdir()
        with self.assertRaisesRegex(ValueError, "masks holds no masks"):
            self.client().submit(folder)
        (masks / "a.png").write_bytes(harness.png(seed=4))
        with self.assertLogs("litags", "INFO") as said:
            job = self.client().submit(folder, options={"iterations": 5})
        self.assertEqual(said.output, [f"INFO:litags:masks: {masks}"])
        self.assertEqual(self.roles(job), {"PHOTO": ["a.png", "b.png", "c.png"], "MASK": ["a.png"]})

    def test_depth_maps_of_a_folder_go_along(self):
        folder, maps = self.photos(), pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        with self.assertRaisesRegex(ValueError, r"holds no depth maps \(\.npy \.pfm \.png\)"):
            self.client().submit(folder, depth=maps)
        (maps / "a.PNG").write_bytes(harness.depth_png())
        job = self.client().submit(folder, depth=maps, options={"iterations": 5})
        self.assertEqual(self.roles(job), {"PHOTO": ["a.png", "b.png", "c.png"], "DEPTH": ["a.PNG"]})

    def test_a_job_may_be_given_by_its_id(self):
        client = self.client()
        job = client.submit(self.photos(), options={"iterations": 5})
        known = job.removeprefix("jobs/")
        self.assertEqual(client.wait(known, progress=False).name, job)
        self.assertEqual(client.job(known).name, job)
        self.assertEqual(client.cameras(known), ["a.png", "b.png", "c.png"])
        self.assertEqual(client.render(known, "a.png"), client.render(job, "a.png"))
        client.export(known, os.path.join(self.folder, "scene.ply"))

    def test_the_environment_that_cannot_be_used_is_named(self):
        missing = os.path.join(self.folder, "missing")
        for environment, error, words in (
                ({"LITAGS_TLS_CERT": __file__}, ValueError, "LITAGS_TLS_KEY belong together"),
                ({"LITAGS_TLS_CA": missing}, OSError, missing),
                ({"LITAGS_TOKEN_FILE": missing}, OSError, missing)):
            with self.assertRaisesRegex(error, words):
                litags.connection.options_of(environment)
        for server in ("127.0.0.2:1", "[::1]:1", "localhost:1"):
            self.assertEqual(litags.connection.options_of({"LITAGS_TOKEN": "x"}, server),
                             {"server": server, "token": "x", "credentials": None, "tls_name": ""})

    def test_a_token_goes_unencrypted_to_this_machine_only(self):
        for server in ("192.0.2.1:443", "127.0.0.1.example.org:1"):
            with self.assertRaisesRegex(ValueError, f"to {server} unencrypted"):
                litags.Client(server, token="x")
            with mock.patch.dict(os.environ, LITAGS_SERVER=server, LITAGS_TOKEN="x"), \
                    self.assertRaisesRegex(ValueError, "unencrypted; .*LITAGS_TLS=1"):
                litags.Client.from_environment()
        self.client("192.0.2.1:443", token="x", credentials=grpc.ssl_channel_credentials())
        for server in ("[::1]:1", "unix:/run/litags.sock"):
            self.client(server, token="x")

    def test_a_proxy_for_the_internet_is_no_way_to_this_machine(self):
        nobody = {name: "http://127.0.0.1:1" for name in ("http_proxy", "https_proxy", "grpc_proxy")}
        with mock.patch.dict(os.environ, nobody):
            for name in ("no_proxy", "no_grpc_proxy"):
                os.environ.pop(name, None)
            job = self.client().submit(self.photos(), options={"iterations": 5})
        self.assertEqual(self.roles(job), {"PHOTO": ["a.png", "b.png", "c.png"]})

    def test_a_server_that_never_answered_is_reported_at_once(self):
        with self.assertRaises(litags.LitagsError) as caught:
            self.client("127.0.0.1:1").submit(self.photos())
        self.assertEqual(caught.exception.code, grpc.StatusCode.UNAVAILABLE)
        self.assertRegex(str(caught.exception),
                         r"\Ano server answers at 127.0.0.1:1: .*LITAGS_SERVER.*\n  UNAVAILABLE\Z")

    def test_a_server_that_vanished_is_waited_for_no_longer_than_said(self):
        server = harness.Server(self.folder)
        client = self.client(server.address, retry_seconds=1)
        job = client.submit(self.photos())
        server.kill()
        with self.assertRaises(litags.LitagsError) as caught:
            client.job(job)
        self.assertEqual(caught.exception.code, grpc.StatusCode.UNAVAILABLE)

    def test_a_server_that_vanished_during_an_upload_leaves_a_job_that_goes_on(self):
        folder = tempfile.mkdtemp(dir=self.class_folder)
        server = harness.Server(folder)
        proxy = harness.CuttableProxy(server.port)
        self.addCleanup(proxy.close)
        photos = self.photos(())
        for seed, name in enumerate(("a.png", "b.png", "c.png")):
            pathlib.Path(photos, name).write_bytes(harness.large_png(seed))

        def vanish(job, batch, upload=litags.Client._upload):
            server.kill()
            proxy.cut()
            upload(client, job, batch)

        client = self.client(proxy.address, retry_seconds=1)
        with mock.patch.object(client, "_upload", vanish), \
                self.assertRaises(litags.LitagsError) as caught:
            client.submit(photos)
        self.assertEqual(caught.exception.code, grpc.StatusCode.UNAVAILABLE)
        job, request = re.search(
            r"; (jobs/\w+) was not started and is still there: submit the same again with "
            r'request_id="([\w-]+)", or remove it with: litags delete jobs/\w+$',
            caught.exception.message).groups()
        server = harness.Server(folder)
        self.addCleanup(server.stop)
        client = self.client(server.address)
        for _ in range(2):  # once more changes nothing
            self.assertEqual(client.submit(photos, request_id=request), job)
        self.assertEqual(client.wait(job).photos, 3)

    def test_a_request_of_other_photos_is_another_one(self):
        client = self.client()
        folders = [self.photos(), self.photos(("a.png", "b.png", "d.png"))]
        job = client.submit(folders[0], request_id="one")
        self.assertEqual(client.submit(folders[0], request_id="one"), job)
        with self.assertRaises(litags.LitagsError) as caught:
            client.submit(folders[1], request_id="one")
        self.assertEqual(caught.exception.reason, "REQUEST_ID_REUSED")
        self.assertIn("other files", caught.exception.message)


class Reconstruct(examples.Refused, harness.ServiceTest):
    """reconstruct.py, as its reader would run it."""

    command = (sys.executable, "-B", "-u", SOURCE / "client/python/reconstruct.py")
    option = ("--iterations",)

    def test_the_example_goes_on_though_uploads_and_watches_are_cut(self):
        photos = self.photos(())
        for seed, name in enumerate(("slow.png", "b.png", "c.png")):
            pathlib.Path(photos, name).write_bytes(harness.large_png(seed))
        proxy = self.new_proxy(cut_every=2 << 20)
        process = self.start(photos, proxy.address, 100)
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "JOB_STATE_RUNNING" in line:
                proxy.cut()
        _, err = self.finish(process)
        self.assertEqual(process.returncode, 0, err)
        self.assertGreaterEqual(proxy.connections, 3)
        self.assertRegex(lines[0], r"\Ajobs/\w+\n")
        # No event twice: a run changes its state three times at most.
        self.assertEqual(sum("JOB_STATE_RUNNING" in line for line in lines), 1, lines)
        self.assertIn("b.png in normal light", lines[-1])
        picture = pathlib.Path(self.folder, "view.png").read_bytes()
        self.assertEqual(harness.png_size(picture), (64, 48))  # the fake engine's
        self.assertTrue(pathlib.Path(self.folder, "scene.ply").read_bytes().startswith(b"ply\n"))

    def test_what_is_refused_is_said_with_its_reason_and_field(self):
        _, err = self.run_program(self.photos(), self.server.address, -1, exit_code=1)
        self.assertRegex(err, r"INVALID_ARGUMENT \w+, field options.iterations")

    def test_a_scene_of_no_known_format_is_refused_before_there_is_a_job(self):
        before = self.states()
        program = subprocess.run([*map(str, self.command), self.photos(), "view.png", "scene.doc"],
                                 env=dict(os.environ, LITAGS_SERVER=self.server.address),
                                 capture_output=True, text=True)
        self.assertEqual(program.returncode, 1)
        self.assertRegex(program.stderr, r"\Ascene.doc ends with none of [^\n]*\n\Z")
        self.assertEqual(self.states(), before)

    def test_a_job_that_fails_says_why(self):
        _, err = self.run_program(self.photos(("fail.png", "b.png", "c.png")),
                                  self.server.address, 40, exit_code=1)
        self.assertRegex(err, r"take photos that overlap more\s+\w+ SFM_TOO_FEW_VIEWS, field images")

    def test_each_step_is_said_once_with_its_message(self):
        step = job_pb2.Progress(stage=job_pb2.STAGE_PREPARING, iterations=100)
        later = job_pb2.Progress(stage=job_pb2.STAGE_PREPARING, iterations=100, message="depth")
        trained = job_pb2.Progress(stage=job_pb2.STAGE_TRAINING, iteration=7, iterations=100)
        events = [job_pb2.JobEvent(progress=progress)
                  for progress in (step, step, later, later, trained)]
        events.insert(1, job_pb2.JobEvent(snapshot=job_pb2.JobEvent.Snapshot(iteration=1)))
        client = mock.MagicMock()
        client.__enter__.return_value = client
        client.watch.return_value = events
        client.render.return_value = b""
        said = io.StringIO()
        arguments = ["reconstruct.py", self.folder, os.path.join(self.folder, "view.png")]
        with contextlib.redirect_stdout(said), mock.patch.object(sys, "argv", arguments), \
                mock.patch("litags.Client.from_environment", return_value=client):
            runpy.run_path(str(self.command[-1]))
        self.assertEqual([line.strip() for line in said.getvalue().splitlines()[1:-1]],
                         ["STAGE_PREPARING", "STAGE_PREPARING depth", "STAGE_TRAINING 7 of 100"])


class SecureReconstruct(examples.Secure, harness.ServiceTest):
    command = Reconstruct.command
    option = Reconstruct.option


class MutualReconstruct(examples.Mutual, harness.ServiceTest):
    command = Reconstruct.command
    option = Reconstruct.option


if __name__ == "__main__":
    unittest.main(verbosity=2)
