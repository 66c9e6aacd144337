"""The services by HTTP: routes, JSON, events, uploads, pictures, downloads."""

import base64
import hashlib
import json
import os
import pathlib
import re
import socket
import time
import unittest

from gateway import GatewayTest, PHOTOS
import harness
from harness import rpc


class Routes(GatewayTest):

    def test_every_call_of_the_services_has_a_route(self):
        source = pathlib.Path(os.environ["LITAGS_SOURCE"])
        calls = set()
        for path in source.joinpath("proto/litags/v1").glob("*_service.proto"):
            service = re.search(r"^service (\w+)", path.read_text(), re.MULTILINE)[1]
            calls |= {f"{service}/{name}"
                      for name in re.findall(r"^  rpc (\w+)\(", path.read_text(), re.MULTILINE)}
        table = source.joinpath("server/web/routes.cc").read_text()
        self.assertEqual(set(re.findall(r'"(\w+Service/\w+)"', table)), calls)

    def test_answers_that_steps_fake_are_checked_against_the_protos(self):
        faked = [(path.name, wrapped) for path in pathlib.Path(__file__).parent.glob("*_steps.mjs")
                 for wrapped in re.findall(r"fulfill\(\s*{\s*json: (checked\()?", path.read_text())]
        self.assertGreater(len(faked), 5)
        self.assertEqual([name for name, wrapped in faked if not wrapped], [])

    def test_a_job_goes_all_the_way(self):
        job = self.web_job()
        found = self.web.get(f"/v1/{job}").json()
        self.assertEqual((found["state"], found["displayName"], found["options"]["iterations"]),
                         ("JOB_STATE_SUCCEEDED", "by HTTP", 40))
        self.assertIn(job, [j["name"] for j in self.web.get("/v1/jobs?pageSize=1000").json()["jobs"]])
        # The same job as by gRPC.
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=job)).display_name, "by HTTP")
        self.assertEqual([f["fileName"] for f in self.web.get(f"/v1/{job}/files").json()["files"]],
                         list(PHOTOS))

    def test_queries_fill_fields_by_either_name(self):
        job = self.web_job()
        listed = self.web.get("/v1/jobs?filter=state%20%3D%20SUCCEEDED").json()["jobs"]
        self.assertIn(job, [j["name"] for j in listed])
        self.new_job(start=False)
        for name in ("pageSize", "page_size"):
            self.assertEqual(len(self.web.get(f"/v1/jobs?{name}=1").json()["jobs"]), 1)

    def test_update_clone_and_delete(self):
        job = self.new_job(start=False)
        reply = self.web.call("PATCH", f"/v1/{job}?updateMask=displayName,labels",
                              {"displayName": "other", "labels": {"site": "north"}})
        self.assertEqual((reply.code, reply.json()["displayName"]), (200, "other"), reply.body)
        # A job as it was read, changed and sent back.
        changed = {**self.web.get(f"/v1/{job}").json(), "displayName": "third"}
        path = f"/v1/{job}?updateMask=displayName"
        reply = self.web.call("PATCH", path, changed)
        self.assertEqual((reply.code, reply.json()["displayName"]), (200, "third"), reply.body)
        self.assert_fails(self.web.call("PATCH", path, {**changed, "name": "jobs/0other"}), 400,
                          "REQUEST_FIELD_INVALID", "twice")
        clone = self.web.post(f"/v1/{job}:clone", {"displayName": "copy"}).json()
        self.assertEqual((clone["photos"], clone["displayName"]), (3, "copy"))
        self.assertEqual(self.web.call("DELETE", f"/v1/{clone['name']}/files/a.png").code, 200)
        self.assertEqual(self.web.get(f"/v1/{clone['name']}").json()["photos"], 2)
        self.assertEqual(self.web.call("DELETE", f"/v1/{clone['name']}").code, 200)
        self.assert_fails(self.web.get(f"/v1/{clone['name']}"), 404, "JOB_NOT_FOUND")
        self.assertEqual(self.web.post("/v1/jobs:batchDelete", {"names": [job]}).json(), {})

    def test_cancel_and_resume(self):
        job = self.new_job(("hang.png", "b.png", "c.png"), {"iterations": 30})
        self.wait_for(lambda: self.state(job) == harness.RUNNING, "a start")
        self.assertEqual(self.web.post(f"/v1/{job}:cancel").code, 200)
        self.wait_for(lambda: self.state(job) == harness.CANCELLED, "the cancel")
        self.assertEqual(self.web.post(f"/v1/{job}:resume").json()["state"], "JOB_STATE_QUEUED")
        self.web.post(f"/v1/{job}:cancel")

    def test_codes_of_errors(self):
        self.assert_fails(self.web.get("/v1/jobs/0nosuchjob"), 404, "JOB_NOT_FOUND")
        self.assert_fails(self.web.get("/v1/jobs/..%2f..%2fetc"), 400, "JOB_NAME_INVALID")
        self.assert_fails(self.web.get("/v1/nothing"), 404, "ROUTE_UNKNOWN")
        self.assert_fails(self.web.get("/nothing"), 404, "ROUTE_UNKNOWN")
        reply = self.web.call("PUT", "/v1/jobs")
        self.assert_fails(reply, 405, "METHOD_UNKNOWN")
        self.assertEqual(reply.headers["Allow"], "POST, GET")
        self.assert_fails(self.web.post(f"/v1/{self.web_job()}:start"), 400, "JOB_NOT_UPLOADING")
        self.assert_fails(self.web.post("/v1/jobs", {"options": {"iterations": -1}}), 400,
                          "BAD_OPTION", "iterations")

    def test_bodies_that_are_no_requests(self):
        for body in ("[]", "{", "7", '"x"', "[" * 100000, '{"a":' * 5000, "\xff\xfe"):
            self.assert_fails(self.web.post("/v1/jobs", body.encode("latin-1")), 400,
                              "REQUEST_NOT_JSON")
        for body in ({"nosuch": 1}, {"options": 3}, {"options": {"method": "METHOD_NONE"}},
                     {"displayName": {"a": 1}}):
            self.assert_fails(self.web.post("/v1/jobs", body), 400, "REQUEST_FIELD_INVALID")
        self.assert_fails(self.web.get("/v1/jobs?nosuch=1"), 400, "REQUEST_FIELD_INVALID", "nosuch")
        self.assert_fails(self.web.get("/v1/jobs?pageSize=1&pageSize=2"), 400,
                          "REQUEST_FIELD_INVALID", "twice")
        self.assert_fails(self.web.get("/v1/jobs?pageSize=many"), 400, "REQUEST_FIELD_INVALID")
        self.assert_fails(self.web.get("/v1/jobs?filter=%ff"), 400, "REQUEST_NOT_JSON")
        self.assert_fails(self.web.get("/v1/jobs?filter=%f"), 400, "REQUEST_UNREADABLE")

    def test_a_body_that_is_too_large(self):
        self.web.get("/v1/jobs")  # strangers may send less, and are cut
        self.assert_fails(self.web.post("/v1/jobs", b" " * (3 << 20)), 413, "BODY_TOO_LARGE")


class Streams(GatewayTest):

    def test_events_come_in_order_and_resume(self):
        job = self.web_job()
        events = list(self.web.events(f"/v1/{job}/events?includePreviews=true"))
        self.assertEqual(events[-1], ("end", None, {}))
        numbers = [number for _, number, _ in events[:-1]]
        self.assertEqual(numbers, list(range(1, len(numbers) + 1)))
        self.assertTrue(any("previewPng" in data.get("progress", {}) for _, _, data in events))
        rest = list(self.web.events(f"/v1/{job}/events", {"Last-Event-ID": "3"}))
        self.assertEqual([number for _, number, _ in rest[:-1]], numbers[3:])
        self.assert_fails(self.web.get(f"/v1/{job}/events", headers={"Last-Event-ID": "x"}), 400,
                          "EVENT_NUMBER_INVALID")
        self.assert_fails(self.web.get(f"/v1/{job}/events?afterEvent=1000000"), 400, "EVENT_NOT_YET")
        self.assert_fails(self.web.get("/v1/jobs/0none/events"), 404, "JOB_NOT_FOUND")

    def test_events_come_as_they_happen(self):
        job = self.new_job(("slow.png", "b.png", "c.png"), {"iterations": 1000})
        events = self.web.events(f"/v1/{job}/events")
        next(data for _, _, data in events if "progress" in data)
        self.assertEqual(self.state(job), harness.RUNNING)  # 1,000 times 20 ms
        self.client().post(f"/v1/{job}:cancel")
        states = [data["stateChange"]["state"] for _, _, data in events if "stateChange" in data]
        self.assertEqual(states[-1], "JOB_STATE_CANCELLED")

    def test_a_watcher_of_a_job_that_is_deleted(self):
        job = self.new_job(start=False)
        events = self.web.events(f"/v1/{job}/events")
        self.assertEqual(next(events)[1], 1)
        self.client().call("DELETE", f"/v1/{job}")
        name, _, data = list(events)[-1]
        self.assertEqual((name, data["code"]), ("failure", 5))

    def test_the_log(self):
        entries = list(self.web.events(f"/v1/{self.web_job()}/log"))
        self.assertTrue(any("a program says" in data.get("text", "") for _, _, data in entries))

    def test_a_path(self):
        self.web.connection.request(
            "POST", f"/v1/{self.web_job()}:renderPath",
            json.dumps({"orbit": {}, "frames": 3, "settings": {"width": 32, "height": 24}}))
        text = self.web.connection.getresponse().read().decode()
        frames = [json.loads(line[6:]) for line in text.splitlines() if line.startswith("data: ")]
        self.assertEqual([f.get("frame", 0) for f in frames[:3]], [0, 1, 2])
        self.assertTrue(all(f["view"]["data"] for f in frames[:3]))


class Files(GatewayTest):

    def test_a_file_in_parts(self):
        job = self.new_job((), start=False)
        data = harness.large_png()
        half = len(data) // 2
        reply = self.web.put_file(job, "large.png", data, 0, half)
        self.assertEqual((reply.code, reply.json()), (202, {"received": str(half)}))
        reply = self.web.put_file(job, "large.png", data, half)
        self.assertEqual((reply.code, reply.json()["filesStored"]), (200, 1), reply.body)

    def test_a_file_that_the_server_has_is_not_sent_again(self):
        data = harness.large_png(seed=2)
        self.assertEqual(self.web.put_file(self.new_job((), start=False), "a.png", data).code, 200)
        job = self.new_job((), start=False)
        reply = self.web.put_file(job, "b.png", data, first=len(data))
        self.assertEqual((reply.code, reply.json()["filesStored"]), (200, 1), reply.body)
        other = harness.large_png(seed=3)
        self.assert_fails(self.web.put_file(job, "c.png", other, first=len(other)), 400,
                          "OFFSET_INVALID")

    def test_a_connection_that_breaks_keeps_what_came(self):
        job = self.new_job((), start=False)
        data = harness.large_png(seed=1)
        digest = base64.b64encode(hashlib.sha256(data).digest()).decode()
        with socket.create_connection(("127.0.0.1", self.server.web_port)) as raw:
            raw.sendall((f"PUT /v1/{job}/files/cut.png HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                         f"Repr-Digest: sha-256=:{digest}:\r\nContent-Length: {len(data)}\r\n\r\n"
                         ).encode() + data[:1 << 20])
        query = {"files": [{"fileName": "cut.png", "sizeBytes": len(data), "sha256": digest}]}

        def have():
            answer = self.web.post(f"/v1/{job}/files:query", query).json()
            return int(answer["files"][0].get("offset", 0))
        self.wait_for(lambda: have() >= 512 << 10, "the bytes that came")
        self.assertEqual(self.web.put_file(job, "cut.png", data, have()).code, 200)

    def test_files_that_are_refused(self):
        job = self.new_job((), start=False)
        data = harness.png()
        self.assert_fails(self.web.put_file(job, "../x.png", data), 400, "BAD_FILE_NAME")
        self.assert_fails(self.web.put_file(job, "x.png", b"no picture"), 400,
                          "IMAGE_NOT_RECOGNIZED")
        reply = self.web.put_file(job, "x.png", data, role="FILE_ROLE_NONE")
        self.assert_fails(reply, 400, "REQUEST_FIELD_INVALID")
        self.assertEqual(reply.detail("google.rpc.ErrorInfo").get("metadata"),
                         {"field": "role"})
        for query in ("Role=FILE_ROLE_MASK", "file.role=FILE_ROLE_MASK", "role=99", "offset=1",
                      "role=FILE_ROLE_MASK&role=FILE_ROLE_PHOTO"):
            self.assert_fails(self.web.call("PUT", f"/v1/{job}/files/x.png?{query}", data), 400,
                              "REQUEST_FIELD_INVALID", query.split("=")[0])
        self.assert_fails(self.web.call("PUT", f"/v1/{job}/files/%ff.png", data), 400,
                          "REQUEST_NOT_JSON")
        violation, = reply.detail("google.rpc.BadRequest")["fieldViolations"]
        self.assertEqual(violation["field"], "role")
        self.assert_fails(self.web.put_file("jobs/0none", "x.png", data), 404, "JOB_NOT_FOUND")
        path = f"/v1/{job}/files/x.png"
        self.assert_fails(self.web.call("PUT", path, data), 400, "FILE_DIGEST_MISSING")
        for value in ("bytes 0-1/", "bytes 1-0/9", "x", "bytes -1-5/9", f"bytes 0-{len(data)}/9",
                      f"bytes */{len(data)}"):
            self.assert_fails(self.web.call("PUT", path, data, {"Content-Range": value}), 400,
                              "CONTENT_RANGE_INVALID")
        for value in ("bytes 1-0/9", "bytes */", "bytes */-1"):
            self.assert_fails(self.web.call("PUT", path, b"", {"Content-Range": value}), 400,
                              "CONTENT_RANGE_INVALID")
        self.assert_fails(self.client().call("PUT", path, iter([data])), 411, "LENGTH_MISSING")
        # A body of one that is refused does not harm the next request.
        self.assertEqual(self.web.put_file(job, "x.png", data, role=1).code, 200)

    def test_names_of_all_kinds(self):
        job = self.new_job((), start=False)
        names = ["a b.png", "ü:x?.png", "50%+1.png", "日本.png"]
        for name in names:
            reply = self.web.put_file(job, name, harness.png())
            self.assertEqual(reply.code, 200, (name, reply.body))
        # A colon need not be escaped.
        data = harness.png(seed=1)
        digest = base64.b64encode(hashlib.sha256(data).digest()).decode()
        path = f"/v1/{job}/files/12:30.png"
        reply = self.web.call("PUT", path, data, {"Repr-Digest": f"sha-256=:{digest}:"})
        self.assertEqual(reply.code, 200, reply.body)
        listed = [f["fileName"] for f in self.web.get(f"/v1/{job}/files").json()["files"]]
        self.assertEqual(sorted(listed), sorted([*names, "12:30.png"]))
        self.assertEqual(self.web.call("DELETE", path).code, 200)


class Refusals(GatewayTest):
    """Codes alone do not say whether to come again."""

    extra = ("--max-job-bytes", "1000", "--pictures-per-second", "0.001", "--picture-burst", "1")

    def test_what_is_refused_for_good(self):
        reply = self.web.put_file(self.new_job((), start=False), "a.png", harness.png())
        self.assert_fails(reply, 413, "JOB_TOO_LARGE")
        self.assertNotIn("Retry-After", reply.headers)

    def test_what_is_refused_for_now(self):
        for _ in range(2):
            reply = self.web.get("/v1/jobs/0none/view?pose.camera=a.png")
        self.assert_fails(reply, 429, "PICTURE_RATE_EXCEEDED")
        self.assertEqual(reply.headers["Retry-After"], "1")


class Pictures(GatewayTest):

    def test_views_as_bytes(self):
        job = self.web_job()
        reply = self.web.get(f"/v1/{job}/view?pose.camera=a.png&settings.width=32")
        self.assertEqual((reply.code, reply.headers["Content-Type"]), (200, "image/png"))
        self.assertEqual(harness.png_size(reply.body), (32, 24))
        said = json.loads(reply.headers["Litags-Answer"])
        self.assertEqual((said["width"], said["iteration"]), (32, 40))
        self.assertNotIn("data", said)
        request = {"pose": {"lookAt": {"eye": {"x": 4}, "target": {}}},
                   "settings": {"width": 40, "height": 30, "format": "PICTURE_FORMAT_JPEG",
                                "channel": "CHANNEL_LIGHT", "light": 0.5}}
        reply = self.web.post(f"/v1/{job}:renderView", request)
        self.assertEqual((reply.code, reply.headers["Content-Type"]), (200, "image/jpeg"))

    def test_views_that_are_refused(self):
        job = self.web_job()
        self.assert_fails(self.web.get(f"/v1/{job}/view"), 400, "POSE_MISSING")
        self.assert_fails(self.web.get(f"/v1/{job}/view?pose.camera=none"), 404, "CAMERA_NOT_FOUND")
        self.assert_fails(self.web.get(f"/v1/{job}/view?pose.camera=a.png&settings.light=nan"), 400,
                          "LIGHT_INVALID|REQUEST_FIELD_INVALID")

    def test_cameras(self):
        cameras = self.web.get(f"/v1/{self.web_job()}/cameras").json()
        self.assertEqual([c["name"] for c in cameras["cameras"]], list(PHOTOS))

    def test_models(self):
        job = self.web_job()
        reply = self.web.get(f"/v1/{job}/model?format=MODEL_FORMAT_SPZ")
        self.assertEqual(reply.code, 200)
        self.assertEqual(int(reply.headers["Content-Length"]), len(reply.body))
        self.assertTrue(reply.body.endswith(b"end"))
        self.assert_fails(self.web.get(f"/v1/{job}/model?light=99"), 400, "LIGHT_INVALID")

    def test_files_come_with_names(self):
        job = self.web_job()
        for query, ending in (("", ".ply"), ("PLY_FULL", ".ply"), ("SPZ", ".spz"), ("SPZ_V4", ".spz"),
                              ("SOG", ".sog"), ("SPLAT", ".splat"), ("COMPRESSED_PLY", ".compressed.ply"),
                              ("GLB", ".glb"), ("USDA", ".usda"), ("COLMAP", ".zip"), ("HTML", ".html"),
                              ("POINTS", ".points.ply"), ("LAS", ".las"), ("MESH_PLY", ".mesh.ply"),
                              ("MESH_GLB", ".mesh.glb"), ("LITAGS", ".litags")):
            with self.subTest(query):
                reply = self.web.get(f"/v1/{job}/model" + (query and f"?format=MODEL_FORMAT_{query}"))
                self.assertEqual(reply.code, 200, reply.body)
                name = job.removeprefix("jobs/") + ending
                self.assertEqual(reply.headers["Content-Disposition"], f'attachment; filename="{name}"')

    def test_a_report_is_the_one_that_the_client_writes(self):
        job = self.web_job()
        reply = self.web.get(f"/v1/{job}/report")
        self.assertEqual((reply.code, reply.headers["Content-Type"]), (200, "text/html; charset=utf-8"))
        name = job.removeprefix("jobs/") + ".html"
        self.assertEqual(reply.headers["Content-Disposition"], f'attachment; filename="{name}"')
        path = pathlib.Path(self.folder, "report.html")
        self.litags("report", job, "-o", str(path))

        def but_when_it_was_written(page):
            return re.sub(r"(Report written</dt><dd>)[^<]*", r"\1", page)
        self.assertEqual(but_when_it_was_written(reply.body.decode()),
                         but_when_it_was_written(path.read_text()))

    def test_reports_that_are_refused(self):
        self.assert_fails(self.web.get("/v1/jobs/0none/report"), 404, "JOB_NOT_FOUND")
        self.assert_fails(self.web.get(f"/v1/{self.web_job()}/report?nosuch=1"), 400,
                          "REQUEST_FIELD_INVALID")

    def test_a_report_of_a_job_that_runs(self):
        job = self.new_job(("slow.png", "b.png", "c.png"), {"iterations": 1000, "previewEvery": 5})
        self.wait_for(lambda: "snapshotIteration" in self.web.get(f"/v1/{job}").json(), "a snapshot")
        reply = self.web.get(f"/v1/{job}/report")
        self.assertIn(b"had not ended", reply.body)
        self.assertEqual(reply.body.count(b"<img"), 6)
        self.web.post(f"/v1/{job}:cancel")

    def test_a_picture_that_nobody_waits_for_is_given_up(self):
        other = self.web_job()
        job = self.new_job(("heavy.png", "b.png", "c.png"), {"iterations": 20})
        self.wait_for(lambda: self.state(job) == harness.SUCCEEDED, "the job")
        for _ in range(3):  # all threads that draw, and more
            with socket.create_connection(("127.0.0.1", self.server.web_port)) as raw:
                raw.sendall(f"GET /v1/{job}/view?pose.camera=b.png HTTP/1.1\r\nHost: 127.0.0.1"
                            "\r\n\r\n".encode())
                time.sleep(0.3)
        began = time.monotonic()
        self.assertEqual(self.web.get(f"/v1/{other}/view?pose.camera=a.png").code, 200)
        self.assertLess(time.monotonic() - began, 15)  # a heavy one takes 20 s


if __name__ == "__main__":
    unittest.main(verbosity=2)
