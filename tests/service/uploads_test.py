"""Uploads over connections that break, and what becomes of those that are given up."""

import contextlib
import hashlib
import io
import os
import re
import shutil
import struct
import tarfile
import tempfile
import threading
import unittest
import zipfile

import grpc

import harness
from harness import rpc


def file_header(name, data, offset=0):
    return rpc.FileHeader(file_name=name, role=rpc.FILE_ROLE_PHOTO, size_bytes=len(data),
                          sha256=hashlib.sha256(data).digest(), offset=offset)


def bytes_on_disk(data_folder):
    """Bytes and names of all files of jobs; the database, the server's lock and the marker of the
    installation are not theirs."""
    files = {}
    for folder in ("blobs/jobs", "blobs/tmp", "blobs/uploads", "uploads", "work", "tmp"):
        for path, _, names in os.walk(os.path.join(data_folder, folder)):
            for name in names:
                with contextlib.suppress(FileNotFoundError):  # removed just now
                    files[os.path.join(path, name)] = os.path.getsize(os.path.join(path, name))
    return files


# One camera, as Metashape exports it.
COLMAP_TEXT = {"cameras": b"1 PINHOLE 64 48 50 50 32 24\n",
               "images": b"1 1 0 0 0 0 0 0 1 a.png\n\n", "points3D": b"1 0 0 4 9 9 9 0\n"}


def colmap_model(x=0.0):
    """The three files of a camera at this place, as COLMAP_TEXT."""
    return {"cameras": struct.pack("<QIi2Q4d", 1, 1, 1, 64, 48, 50 + x, 50, 32, 24),
            "images": struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, -x, 0, 0, 1) + b"a.png\0" +
                      struct.pack("<Q", 0),
            "points3D": struct.pack("<QQ3d3BdQ", 1, 1, x, 0, 4, 9, 9, 9, 0, 0)}


METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk><sensors><sensor id="0" type="frame"><calibration type="frame">
<resolution width="64" height="48"/><f>60</f></calibration></sensor></sensors>
<cameras><camera id="0" sensor_id="0" label="{label}"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
</transform></camera></cameras></chunk></document>"""


class Uploads(harness.ServiceTest):

    def large_photos(self, seeds):
        folder = tempfile.mkdtemp(dir=self.folder)
        for seed in seeds:
            with open(os.path.join(folder, f"{seed}.png"), "wb") as file:
                file.write(harness.large_png(seed))
        return folder

    def bytes_kept(self):
        return sum(bytes_on_disk(self.server.data).values())

    def test_files_larger_than_any_connection_lives_arrive(self):
        # Three files of 3.2 MB over connections that live for 1 MB: sent whole, none would arrive.
        proxy = self.new_proxy(cut_every=1 << 20, progress=self.bytes_kept)
        photos = self.large_photos((1, 2, 3))
        out, err = self.litags("submit", photos, "--iterations", "10", server=proxy.address)
        job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
        self.assertEqual(job.photos, 3)
        self.assertGreaterEqual(proxy.connections, 9, err)
        # What a cut costs is what was on its way then, in buffers of the kernel and the proxy.
        self.assertLess(proxy.sent, 2 * job.bytes)

    def test_an_upload_goes_on_after_kill_9_of_the_server(self):
        folder = tempfile.mkdtemp(prefix="litags-upload-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        server = harness.Server(folder)
        proxy = harness.CuttableProxy(server.port, silent_after=5 << 20)
        self.addCleanup(proxy.close)
        submit = self.start_litags("submit", self.large_photos((4, 5, 6)), "--iterations", "10",
                                   server=proxy.address)
        # What the server has, not what is on its way: that is lost with it.
        self.wait_for(lambda: sum(bytes_on_disk(server.data).values()) > 4 << 20,
                      "the upload to be half way")
        server.kill()
        server = harness.Server(folder, server.port)
        self.addCleanup(server.stop)
        sent = proxy.sent
        proxy.silent_after, proxy.silent = 0, False
        proxy.cut()
        out, err = submit.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(submit.returncode, 0, err)
        with grpc.insecure_channel(server.address) as channel:
            stub = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel)
            job = stub.GetJob(rpc.GetJobRequest(name=out.strip()))
        self.assertEqual(job.photos, 3)
        self.assertLess(proxy.sent - sent, job.bytes - (2 << 20))

    def test_an_upload_that_was_given_up_says_how_it_goes_on(self):
        folder = tempfile.mkdtemp(prefix="litags-upload-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        server = harness.Server(folder)
        proxy = harness.CuttableProxy(server.port, silent_after=5 << 20)
        self.addCleanup(proxy.close)
        args = ("submit", self.large_photos((10, 11, 12)), "--iterations", "10")
        submit = self.start_litags(*args, "--retry", "1", server=proxy.address)
        self.wait_for(lambda: sum(bytes_on_disk(server.data).values()) > 4 << 20,
                      "the upload to be half way")
        server.kill()
        proxy.cut()
        _, err = submit.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(submit.returncode, 3, err)
        job, request = re.search(r"(jobs/\w+) was not started and is still there; continue it with "
                                 r"the same command and (--request-id \w+),", err).groups()
        server = harness.Server(folder)
        self.addCleanup(server.stop)
        out, _ = self.litags(*args, *request.split(), server=server.address)
        self.assertEqual(out.strip(), job)

    def test_an_upload_that_a_busy_server_refused_is_kept(self):
        folder = tempfile.mkdtemp(prefix="litags-upload-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        server = harness.Server(folder, extra=("--max-streams", "1"))
        self.addCleanup(server.stop)
        out, _ = self.litags("submit", self.photos(), "--iterations", "100000", server=server.address)
        watch = self.start_litags("watch", out.strip(), "--json", server=server.address)
        self.addCleanup(watch.kill)
        watch.stdout.readline()  # it has the stream
        args = ("submit", self.photos(), "--iterations", "10")
        _, err = self.litags(*args, "--retry", "1", server=server.address, exit_code=5)
        job, request = re.search(r"(jobs/\w+) was not started and is still there; continue it with "
                                 r"the same command and (--request-id \w+),", err).groups()
        watch.kill()
        self.litags("cancel", out.strip(), server=server.address)
        out, _ = self.litags(*args, *request.split(), server=server.address)
        self.assertEqual(out.strip(), job)

    def test_the_same_photos_are_sent_once_for_several_jobs(self):
        photos = self.large_photos((7, 8, 9))
        self.litags("submit", photos, "--iterations", "10")
        proxy = self.new_proxy()
        out, _ = self.litags("submit", photos, "--iterations", "20", server=proxy.address)
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=out.strip())).photos, 3)
        self.assertLess(proxy.sent, 100_000)

    def test_a_request_id_with_other_photos_is_refused(self):
        photos = self.photos()
        args = ("submit", photos, "--iterations", "10", "--request-id", os.path.basename(photos))
        first, _ = self.litags(*args)
        again, _ = self.litags(*args)
        self.assertEqual(first, again)
        with open(os.path.join(photos, "d.png"), "wb") as file:
            file.write(harness.png(seed=9))
        _, err = self.litags(*args, exit_code=2)
        self.assertIn("REQUEST_ID_REUSED", err)
        self.assertIn("with other files", err)

    def test_python_asks_what_is_missing_and_sends_the_rest(self):
        job = self.jobs.CreateJob(rpc.CreateJobRequest()).name
        data = harness.large_png(9)

        def part(offset, end):
            yield rpc.UploadImagesRequest(name=job)
            yield rpc.UploadImagesRequest(file=file_header("a.png", data, offset))
            for start in range(offset, end, 256 << 10):
                yield rpc.UploadImagesRequest(chunk=data[start:min(start + (256 << 10), end)])
            if end == len(data):
                yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=1))

        def missing():
            return self.jobs.QueryUpload(rpc.QueryUploadRequest(
                name=job, files=[file_header("a.png", data)])).files[0]

        self.assert_refused(lambda: self.jobs.UploadImages(part(0, 1_000_000)),
                            grpc.StatusCode.INVALID_ARGUMENT, "FILE_TRUNCATED", "images[a.png]",
                            "send the rest")
        self.assertEqual((missing().stored, missing().offset), (False, 1_000_000))
        self.jobs.UploadImages(part(1_000_000, len(data)))
        self.assertTrue(missing().stored)


class Findings(harness.ServiceTest):

    def test_what_would_be_used_is_said_before_the_start(self):
        photos = self.photos()
        shutil.copy(os.path.join(photos, "a.png"), os.path.join(photos, "d.png"))
        out, err = self.litags("submit", photos, "--iterations", "10")
        self.assertRegex(err, r"(?m)^3 photos would be used, 1 is left out; 64x48 px; light: ")
        self.assertIn("left out: d.png: it is the same photo as a.png\n", err)
        table, _ = self.litags("files", out.strip())
        self.assertRegex(table, r"(?m)^photo .* 64x48 .* c\.png$")
        self.assertRegex(table, r"d\.png  \(left out: it is the same photo as a\.png\)")


class Masks(harness.ServiceTest):

    def folder_with_masks(self, **masks):
        photos = self.photos()
        os.mkdir(os.path.join(photos, "masks"))
        for name, data in masks.items():
            with open(os.path.join(photos, "masks", name + ".png"), "wb") as file:
                file.write(data)
        return photos

    def test_masks_beside_the_photos_go_with_them_and_end_in_a_model(self):
        photos = self.folder_with_masks(a=harness.mask_png(), c=harness.mask_png())
        out, err = self.litags("submit", photos, "--iterations", "10", "--watch")
        self.assertIn(f"with 2 masks from {photos}/masks", err)
        job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
        self.assertEqual((job.state, job.photos), (harness.SUCCEEDED, 3))
        self.assertIn("2 photos have a mask", job.report.notes)
        self.litags("delete", job.name)
        self.wait_for(lambda: not bytes_on_disk(self.server.data), "an empty data folder")

    def test_a_mask_of_another_size_is_refused_and_the_job_removed_again(self):
        photos = self.folder_with_masks(b=harness.mask_png(48, 64))
        _, err = self.litags("submit", photos, exit_code=2)
        self.assertIn("MASK_SIZE", err)
        self.assertIn("masks[b.png]", err)
        self.assertIn("was removed again", err)


class Archives(harness.ServiceTest):

    def path(self, name):
        return os.path.join(tempfile.mkdtemp(dir=self.folder), name)

    def zip(self, files, name="capture.zip"):
        path = self.path(name)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for entry, data in files:
                archive.writestr(entry, data)
        return path

    def tar(self, files, name="capture.tar.gz"):
        path = self.path(name)
        with tarfile.open(path, "w:gz" if name.endswith("gz") else "w") as archive:
            for entry, data in files:
                info = entry if isinstance(entry, tarfile.TarInfo) else tarfile.TarInfo(entry)
                info.size = len(data)
                archive.addfile(info, io.BytesIO(data))
        return path

    def capture(self):
        return [("night/images/a.png", harness.png(seed=1)),
                ("night/images/b.png", harness.png(seed=2)),
                ("night/images/c.png", harness.png(seed=3)),
                ("night/depth/a.png", harness.depth_png()),
                ("night/masks/a.png.png", harness.mask_png()),
                ("night/masks/notes.txt", b"made by hand"),
                ("night/README.txt", b"taken at night"),
                ("__MACOSX/night/._a.png", b"junk")]

    def test_a_packed_folder_becomes_a_job(self):
        for path in (self.zip(self.capture()), self.tar(self.capture()),
                     self.tar(self.capture(), "capture.tar")):
            out, err = self.litags("submit", path, "--iterations", "10", "--watch")
            job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
            self.assertEqual((job.state, job.photos), (harness.SUCCEEDED, 3))
            self.assertTrue(job.report.depth_used)
            self.assertIn("1 photos have a mask", job.report.notes)
            self.assertIn("not used, of what is in the archive: night/masks/notes.txt, "
                          "night/README.txt", err)
        self.wait_for(lambda: not os.listdir(os.path.join(self.server.data, "tmp")), "an empty tmp")

    def test_of_very_many_files_that_are_not_used_the_number_is_told(self):
        notes = [(f"night/{i}.txt", b"by hand") for i in range(150)]
        _, err = self.litags("submit", self.zip(self.capture()[:3] + notes), "--iterations", "10")
        self.assertIn("night/4.txt and 145 more", err)

    def test_of_a_dataset_one_size_of_photos_and_one_model_are_used(self):
        photos = [(f"room/{folder}/{name}.png", harness.png(width, height, seed=seed))
                  for folder, width, height in (("images", 64, 48), ("images_2", 32, 24))
                  for seed, name in enumerate("abc")]
        models = [(f"room/{folder}/{name}.bin", data)
                  for x, folder in enumerate(("sparse/0", "distorted/sparse/0"))
                  for name, data in colmap_model(x).items()]
        for path in (self.zip(photos + models), self.tar(models + photos)):
            out, err = self.litags("submit", path, "--iterations", "10", "--watch")
            job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
            self.assertEqual((job.photos, job.report.sfm_preparation), (3, "given"))
            self.assertIn("room/images_2/ (the photos are those in room/images/)", err)
            self.assertIn("room/distorted/ (the photos are those in room/images/)", err)

    def test_a_large_archive_arrives_over_connections_that_break(self):
        proxy = harness.CuttableProxy(
            self.server.port, cut_every=1 << 20,
            progress=lambda: sum(bytes_on_disk(self.server.data).values()))
        self.addCleanup(proxy.close)
        path = self.zip([(f"{seed}.png", harness.large_png(seed)) for seed in (21, 22, 23)])
        out, _ = self.litags("submit", path, "--iterations", "10", server=proxy.address)
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=out.strip())).photos, 3)
        self.assertGreaterEqual(proxy.connections, 6)

    def refused(self, path, reason, words):
        before = {job.name for job in self.jobs.ListJobs(rpc.ListJobsRequest()).jobs}
        _, err = self.litags("submit", path, exit_code=2)
        self.assertIn(reason, err)
        self.assertIn(words, err)
        after = {job.name for job in self.jobs.ListJobs(rpc.ListJobsRequest()).jobs}
        self.assertEqual(before, after)  # the job was removed again

    def test_hostile_archives_are_refused_by_the_name_of_the_entry(self):
        photo = harness.png()
        self.refused(self.zip([("../../evil.png", photo)]), "ARCHIVE_ENTRY_UNSAFE",
                     "../../evil.png")
        self.refused(self.tar([("/etc/evil.png", photo)]), "ARCHIVE_ENTRY_UNSAFE", "/etc/evil.png")
        for kind in (tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.FIFOTYPE):
            link = tarfile.TarInfo("trap.png")
            link.type, link.linkname = kind, "/etc/passwd"
            self.refused(self.tar([(link, b"")]), "ARCHIVE_ENTRY_UNSAFE", "trap.png")
        self.refused(self.zip([("a/1.png", photo), ("b/1.png", photo)]), "ARCHIVE_NAME_TWICE",
                     "a/1.png and b/1.png")
        self.refused(self.zip([("1.png", b"no photo at all")]), "TOO_FEW_PHOTOS",
                     "not used, of what is in the archive: 1.png")
        path = self.path("text.zip")
        with open(path, "wb") as file:
            file.write(b"this is no archive")
        self.refused(path, "ARCHIVE_NOT_RECOGNIZED", "archives[text.zip]")
        self.assertFalse(os.path.exists(os.path.join(self.server.data, "evil.png")))

    def test_a_bomb_is_refused_and_leaves_nothing(self):
        self.refused(self.zip([("bomb.png", bytes(100 << 20))]), "ARCHIVE_RATIO_TOO_LARGE",
                     "times its size")
        self.assertEqual(os.listdir(os.path.join(self.server.data, "uploads")), [])

    def test_known_cameras_may_be_a_colmap_model(self):
        for form, files in (("bin", colmap_model()), ("txt", COLMAP_TEXT)):
            model = tempfile.mkdtemp(dir=self.folder)
            for name, data in files.items():
                with open(os.path.join(model, f"{name}.{form}"), "wb") as file:
                    file.write(data)
            out, _ = self.litags("submit", self.photos(), "--cameras", model, "--iterations", "10",
                                 "--watch")
            job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
            self.assertEqual(job.report.sfm_preparation, "given")
            os.remove(os.path.join(model, f"images.{form}"))
            _, err = self.litags("submit", self.photos(), "--cameras", model, exit_code=2)
            self.assertIn(f"images.{form}", err)

    def test_known_cameras_may_be_metashapes(self):
        cameras = METASHAPE.format(label="a")
        path = os.path.join(self.folder, "cameras.xml")
        with open(path, "w") as file:
            file.write(cameras)
        in_archive = self.zip(self.capture() + [("site/cameras.xml", cameras.encode())])
        for arguments in ((self.photos(), "--cameras", path), (in_archive,)):
            out, _ = self.litags("submit", *arguments, "--iterations", "10", "--watch")
            job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
            self.assertEqual(job.report.sfm_preparation, "given")
        with open(path, "w") as file:
            file.write(cameras[:-10])
        _, err = self.litags("submit", self.photos(), "--cameras", path, exit_code=2)
        self.assertRegex(err, r"cameras\[cameras.xml\]: line 5: (?s:.*)BAD_XML")

    def test_known_cameras_may_be_bundlers_with_its_list_of_photos(self):
        path = os.path.join(self.folder, "room.bundle.out")
        with open(path, "w") as file:
            file.write("# Bundle file v0.3\n1 0\n60 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n")
        _, err = self.litags("submit", self.photos(), "--cameras", path, exit_code=2)
        self.assertRegex(err, "BAD_BUNDLE")
        with open(os.path.join(self.folder, "room.list.txt"), "w") as file:
            file.write("a.png\n")
        out, _ = self.litags("submit", self.photos(), "--cameras", path, "--iterations", "10",
                             "--watch")
        job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
        self.assertEqual(job.report.sfm_preparation, "given")

    def test_text_models_in_archives_are_known_by_their_folder(self):
        model = [(f"night/sparse/0/{name}.txt", data) for name, data in COLMAP_TEXT.items()]
        out, _ = self.litags("submit", self.zip(self.capture() + model), "--iterations", "10",
                             "--watch")
        job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
        self.assertEqual(job.report.sfm_preparation, "given")
        out, err = self.litags("submit", self.zip(self.capture() + [("images.txt", b"my notes")]),
                               "--iterations", "10", "--watch")
        self.assertIn("images.txt", err)  # as not used


class Expiry(harness.ServiceTest):

    @classmethod
    def make_server(cls):
        return harness.Server(cls.class_folder, extra=("--keep-uploads", "8", "--sweep-every", "0.2"))

    def test_broken_uploads_expire_and_their_space_is_free_again(self):
        data = harness.large_png(1)
        for i in range(5):
            job = self.jobs.CreateJob(rpc.CreateJobRequest()).name  # lives for 8 s without a sign
            released = threading.Event()

            def messages():
                yield from self.upload(job, [("whole.png", harness.png(seed=i))], end=False)
                yield rpc.UploadImagesRequest(file=file_header("part.png", data))
                yield rpc.UploadImagesRequest(chunk=data[:1 << 20])
                released.wait(harness.PATIENCE_S)

            call = self.jobs.UploadImages.future(messages())
            query = rpc.QueryUploadRequest(name=job, files=[file_header("part.png", data)])
            self.wait_for(lambda: self.jobs.QueryUpload(query).files[0].offset == 1 << 20,
                          "the bytes to arrive")
            self.assertGreater(sum(bytes_on_disk(self.server.data).values()), 1 << 20)
            call.cancel()  # as if the connection had broken
            released.set()
        self.wait_for(lambda: not self.jobs.ListJobs(rpc.ListJobsRequest()).jobs, "the expiry")
        self.wait_for(lambda: not bytes_on_disk(self.server.data), "an empty disk")

    def test_a_job_is_removed_when_its_retention_is_over(self):
        out, _ = self.litags("submit", self.photos(), "--iterations", "10", "--keep-seconds", "1")
        job = out.strip()  # may be gone already: no client is as quick as the sweep on a bad day
        kept, _ = self.litags("submit", self.photos(), "--iterations", "10", "--watch")
        names = lambda: [job.name for job in self.jobs.ListJobs(rpc.ListJobsRequest()).jobs]
        self.wait_for(lambda: job not in names(), "the removal")
        self.assertIn(kept.strip(), names())
        self.wait_for(lambda: not [path for path in bytes_on_disk(self.server.data)
                                   if job.removeprefix("jobs/") in path], "its files to go")
        self.litags("delete", kept.strip())

    def test_a_cancelled_upload_leaves_only_what_it_was_told_is_stored(self):
        data = harness.large_png(2)
        job = self.jobs.CreateJob(rpc.CreateJobRequest()).name
        with self.assertRaises(grpc.RpcError):
            self.jobs.UploadImages(iter([rpc.UploadImagesRequest(name=job),
                                         rpc.UploadImagesRequest(file=file_header("a.png", data)),
                                         rpc.UploadImagesRequest(chunk=data[:1 << 20])]))
        self.assertEqual(sum(bytes_on_disk(self.server.data).values()), 1 << 20)
        self.jobs.CancelJob(rpc.CancelJobRequest(name=job))
        self.assertEqual(bytes_on_disk(self.server.data), {})
        self.jobs.DeleteJob(rpc.DeleteJobRequest(name=job))


if __name__ == "__main__":
    unittest.main(verbosity=2)
