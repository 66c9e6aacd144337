"""The services by HTTP: routes, JSON, events, uploads, pictures, downloads, sessions, bad input."""

import concurrent.futures
import contextlib
import json
import os
import pathlib
import re
import socket
import ssl
import subprocess
import tempfile
import time
import unittest

import gateway
import harness
from harness import rpc

PHOTOS = ("a.png", "b.png", "c.png")


class GatewayTest(harness.ServiceTest):
    """One server without tokens."""

    extra = ()

    @classmethod
    def make_server(cls):
        return gateway.WebServer(cls.class_folder, extra=cls.extra)

    def setUp(self):
        super().setUp()
        self.web = self.client()

    def client(self, **more):
        """One more connection."""
        client = gateway.Client(self.server.web_port, **more)
        self.addCleanup(client.connection.close)
        return client

    def new_job(self, names=PHOTOS, options=None, start=True):
        """A job made by HTTP alone."""
        job = self.web.post("/v1/jobs", {"displayName": "by HTTP", "options": options or {}}).json()
        for seed, name in enumerate(names):
            reply = self.web.put_file(job["name"], name, harness.png(seed=seed))
            self.assertEqual(reply.code, 200, reply.body)
        if start:
            self.assertEqual(self.web.post(f"/v1/{job['name']}:start").json()["state"],
                             "JOB_STATE_QUEUED")
        return job["name"]

    def web_job(self):
        """A finished job; the same for a whole class."""
        cls = type(self)
        if not hasattr(cls, "done"):
            cls.done = self.new_job(options={"iterations": 40, "previewEvery": 10})
            self.wait_for(lambda: self.state(cls.done) == harness.SUCCEEDED, "the job's end")
        return cls.done

    def assert_fails(self, reply, code, reason, words="."):
        self.assertEqual(reply.code, code, reply.body)
        self.assertEqual(reply.reason(), reason)
        self.assertRegex(reply.json()["message"], words)


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

    def test_a_job_goes_all_the_way(self):
        job = self.web_job()
        found = self.web.get(f"/v1/{job}").json()
        self.assertEqual((found["state"], found["displayName"], found["options"]["iterations"]),
                         ("JOB_STATE_SUCCEEDED", "by HTTP", 40))
        self.assertIn(job, [j["name"] for j in self.web.get("/v1/jobs?pageSize=1000").json()["jobs"]])
        # The same job as by gRPC.
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=job)).display_name, "by HTTP")
        self.assertEqual([f["name"] for f in self.web.get(f"/v1/{job}/files").json()["files"]],
                         list(PHOTOS))

    def test_queries_fill_fields_by_either_name(self):
        job = self.web_job()
        for name in ("filter", "filter"):
            listed = self.web.get(f"/v1/jobs?{name}=state%20%3D%20SUCCEEDED").json()["jobs"]
            self.assertIn(job, [j["name"] for j in listed])
        self.assertEqual(len(self.web.get("/v1/jobs?page_size=1").json()["jobs"]), 1)

    def test_update_clone_and_delete(self):
        job = self.new_job(start=False)
        reply = self.web.call("PATCH", f"/v1/{job}?updateMask=displayName,labels",
                              {"displayName": "other", "labels": {"site": "north"}})
        self.assertEqual((reply.code, reply.json()["displayName"]), (200, "other"), reply.body)
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
        job = self.new_job(("slow.png", "b.png", "c.png"), {"iterations": 100})
        began = time.monotonic()
        states = [data["stateChange"]["state"]
                  for _, _, data in self.web.events(f"/v1/{job}/events") if "stateChange" in data]
        self.assertEqual(states[-1], "JOB_STATE_SUCCEEDED")
        self.assertGreater(time.monotonic() - began, 1)  # 100 times 20 ms, not all from the past

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

    def test_a_connection_that_breaks_keeps_what_came(self):
        job = self.new_job((), start=False)
        data = harness.large_png(seed=1)
        digest = gateway.base64.b64encode(gateway.hashlib.sha256(data).digest()).decode()
        with socket.create_connection(("127.0.0.1", self.server.web_port)) as raw:
            raw.sendall((f"PUT /v1/{job}/files/cut.png HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                         f"Repr-Digest: sha-256=:{digest}:\r\nContent-Length: {len(data)}\r\n\r\n"
                         ).encode() + data[:1 << 20])
        query = {"files": [{"name": "cut.png", "sizeBytes": len(data), "sha256": digest}]}

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
        self.assert_fails(self.web.put_file(job, "x.png", data, role="FILE_ROLE_NONE"), 400,
                          "REQUEST_FIELD_INVALID")
        self.assert_fails(self.web.put_file("jobs/0none", "x.png", data), 404, "JOB_NOT_FOUND")
        path = f"/v1/{job}/files/x.png"
        self.assert_fails(self.web.call("PUT", path, data), 400, "FILE_DIGEST_MISSING")
        for value in ("bytes 0-1/", "bytes 1-0/9", "x", "bytes -1-5/9", f"bytes 0-{len(data)}/9"):
            self.assert_fails(self.web.call("PUT", path, data, {"Content-Range": value}), 400,
                              "CONTENT_RANGE_INVALID")
        self.assert_fails(self.client().call("PUT", path, iter([data])), 411, "LENGTH_MISSING")
        # A body of one that is refused does not harm the next request.
        self.assertEqual(self.web.put_file(job, "x.png", data).code, 200)

    def test_names_of_all_kinds(self):
        job = self.new_job((), start=False)
        names = ["a b.png", "ü:x?.png", "50%+1.png", "日本.png"]
        for name in names:
            reply = self.web.put_file(job, name, harness.png())
            self.assertEqual(reply.code, 200, (name, reply.body))
        listed = [f["name"] for f in self.web.get(f"/v1/{job}/files").json()["files"]]
        self.assertEqual(sorted(listed), sorted(names))


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

    def assert_fails(self, reply, code, reason, words="."):
        self.assertEqual(reply.code, code, reply.body)
        self.assertRegex(reply.reason(), reason)

    def test_cameras(self):
        cameras = self.web.get(f"/v1/{self.web_job()}/cameras").json()
        self.assertEqual([c["name"] for c in cameras["cameras"]], list(PHOTOS))

    def test_models(self):
        job = self.web_job()
        reply = self.web.get(f"/v1/{job}/model?format=MODEL_FORMAT_SPZ")
        self.assertEqual(reply.code, 200)
        self.assertEqual(int(reply.headers["Content-Length"]), len(reply.body))
        self.assertTrue(reply.body.endswith(b"end"))
        self.assertEqual(reply.headers["Content-Disposition"], "attachment")
        self.assert_fails(self.web.get(f"/v1/{job}/model?light=99"), 400, "LIGHT_INVALID")

    def test_a_picture_that_nobody_waits_for_is_given_up(self):
        job = self.new_job(("heavy.png", "b.png", "c.png"), {"iterations": 20})
        self.wait_for(lambda: self.state(job) == harness.SUCCEEDED, "the job")
        for _ in range(3):  # all threads that draw, and more
            with socket.create_connection(("127.0.0.1", self.server.web_port)) as raw:
                raw.sendall(f"GET /v1/{job}/view?pose.camera=b.png HTTP/1.1\r\nHost: 127.0.0.1"
                            "\r\n\r\n".encode())
                time.sleep(0.3)
        began = time.monotonic()
        self.assertEqual(self.web.get(f"/v1/{self.web_job()}/view?pose.camera=a.png").code, 200)
        self.assertLess(time.monotonic() - began, 15)  # a heavy one takes 20 s


class Browsers(GatewayTest):
    """What pages of other sites may do: nothing."""

    def test_the_page_and_its_headers(self):
        for path in ("/", "/app.js", "/v1/jobs", "/nothing"):
            headers = self.web.get(path).headers
            self.assertEqual(headers["X-Content-Type-Options"], "nosniff")
            self.assertIn("default-src 'self'", headers["Content-Security-Policy"])
            self.assertIn("frame-ancestors 'none'", headers["Content-Security-Policy"])
            self.assertNotIn("Access-Control-Allow-Origin", headers)
        page = self.web.get("/")
        again = self.web.get("/", headers={"If-None-Match": page.headers["ETag"]})
        self.assertEqual((again.code, again.body), (304, b""))
        self.assertEqual(self.web.call("HEAD", "/").headers["Content-Length"], str(len(page.body)))
        self.assert_fails(self.web.post("/"), 405, "METHOD_UNKNOWN")

    def test_requests_of_other_sites(self):
        host = f"127.0.0.1:{self.server.web_port}"
        for headers in ({"Origin": "https://evil.example"}, {"Origin": "null"},
                        {"Origin": f"http://{host}.evil.example"},
                        {"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"}):
            for method, path in (("POST", "/v1/jobs"), ("GET", "/v1/jobs"), ("POST", "/v1/session")):
                self.assert_fails(self.web.call(method, path, "{}", headers), 403,
                                  "CROSS_SITE_REFUSED")
        own = {"Origin": f"http://{host}", "Sec-Fetch-Site": "same-origin"}
        self.assertEqual(self.web.post("/v1/jobs", {}, headers=own).code, 200)

    def test_names_that_were_made_to_mean_this_machine(self):
        for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", ""):
            self.assert_fails(self.web.get("/v1/jobs", headers={"Host": host}), 403,
                              "HOST_NOT_LOCAL")
        for host in ("localhost", "localhost:8080", "127.0.0.1", "[::1]:80"):
            self.assertEqual(self.web.get("/v1/jobs", headers={"Host": host}).code, 200)


class Tokens(GatewayTest):
    """The clients alice and bob, on plaintext of this machine."""

    @classmethod
    def make_server(cls):
        cls.tokens = {}
        entries = []
        for name in ("alice", "bob"):
            made = subprocess.run([f"{harness.BIN}/{harness.SERVER_PROGRAM}", "token", name],
                                  capture_output=True, text=True, check=True)
            cls.tokens[name] = made.stdout.strip()
            entries.append(made.stderr.split("--token ")[1].strip())
        return gateway.WebServer(cls.class_folder, extra=("--token", ",".join(entries)))

    def log_in(self, name):
        """The cookie, as a browser would send it."""
        reply = self.web.post("/v1/session", {"token": self.tokens[name]})
        self.assertEqual(reply.code, 200, reply.body)
        cookie = reply.headers["Set-Cookie"]
        self.assertIn("HttpOnly", cookie)
        self.assertIn("SameSite=Strict", cookie)
        return {"Cookie": "theme=dark; " + cookie.split(";")[0]}

    def test_wrong_and_missing_tokens(self):
        for headers in ({}, {"Authorization": "Bearer wrong"}, {"Cookie": "litags_token=wrong"},
                        {"Cookie": "litags_token="}, {"Cookie": "=;;litags_token"}):
            reply = self.web.get("/v1/jobs", headers=headers)
            self.assert_fails(reply, 401, "TOKEN_MISSING|TOKEN_INVALID")
        for body in ({"token": "wrong"}, {"token": ""}, {"token": 3}, {"token": "a\r\nSet-Cookie: x"},
                     {}, "no json"):
            reply = self.web.call("POST", "/v1/session", body if isinstance(body, str)
                                  else json.dumps(body))
            self.assertEqual(reply.code, 401, reply.body)
            self.assertNotIn("Set-Cookie", reply.headers)

    def assert_fails(self, reply, code, reason, words="."):
        self.assertEqual(reply.code, code, reply.body)
        self.assertRegex(reply.reason(), reason)

    def test_a_session(self):
        alice = self.log_in("alice")
        job = self.web.post("/v1/jobs", {}, headers=alice).json()
        self.assertEqual(job["owner"], "alice")
        self.assertEqual(self.web.get("/v1/serverInfo", headers=alice).json()["client"]["name"],
                         "alice")
        gone = self.web.call("DELETE", "/v1/session")
        self.assertIn("Max-Age=0", gone.headers["Set-Cookie"])
        # Any other client is told that there is no such job, by every way.
        bob = self.log_in("bob")
        bearer = {"Authorization": f"Bearer {self.tokens['bob']}"}
        for headers in (bob, bearer, {**alice, **bearer}):
            self.assert_fails(self.web.get(f"/v1/{job['name']}", headers=headers), 404,
                              "JOB_NOT_FOUND")
            self.assertEqual(self.web.get("/v1/jobs", headers=headers).json().get("jobs", []), [])

    def test_tokens_free_the_name_of_the_machine(self):
        alice = {**self.log_in("alice"), "Host": "photos.example"}
        self.assertEqual(self.web.get("/v1/jobs", headers=alice).code, 200)

    def test_strangers_bytes_are_not_taken(self):
        self.assert_fails(self.web.put_file("jobs/0none", "x.png", bytes(1 << 20)), 401, "TOKEN_MISSING")


class Hostile(GatewayTest):
    """Connections that cost, on a server with little room."""

    extra = ("--max-web-connections", "40", "--max-unread", "2", "--max-upload-silence", "2")

    def raw(self, text):
        connection = socket.create_connection(("127.0.0.1", self.server.web_port))
        self.addCleanup(connection.close)
        connection.settimeout(harness.PATIENCE_S)
        connection.sendall(text)
        return connection

    def answer(self, text):
        connection = self.raw(text)
        data = b""
        with contextlib.suppress(ConnectionResetError):
            while piece := connection.recv(65536):
                data += piece
        return data

    def test_what_is_no_request(self):
        for text in (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"GET\r\n\r\n",
                     b"GET  / HTTP/1.1\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n",
                     b"GET / HTTP/1.1\r\nno colon\r\n\r\n", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
                     b"GET nopath HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
                     b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: x\r\n\r\n",
                     b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 5\r\n"
                     b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"):
            said = self.answer(text)
            self.assertTrue(said.startswith(b"HTTP/1.1 4") or not said, (text, said[:200]))
        said = self.answer(b"GET / HTTP/1.1\r\nX: " + b"y" * 20000 + b"\r\n\r\n")
        self.assertTrue(said.startswith(b"HTTP/1.1 431"), said[:200])
        self.assertEqual(self.web.get("/v1/jobs").code, 200)

    def test_a_body_that_stops(self):
        said = self.answer(b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\n\r\n{")
        self.assertTrue(said.startswith(b"HTTP/1.1 504") or not said, said[:200])

    def test_expect_continue(self):
        connection = self.raw(b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n"
                              b"Expect: 100-continue\r\nConnection: close\r\n\r\n")
        self.assertTrue(connection.recv(100).startswith(b"HTTP/1.1 100 "))
        connection.sendall(b"{}")
        self.assertTrue(connection.recv(100).startswith(b"HTTP/1.1 200 "))

    def test_requests_one_after_the_other(self):
        one = b"GET /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\n%s\r\n"
        said = self.answer(one % b"" * 3 + one % b"Connection: close\r\n")
        self.assertEqual(said.count(b"HTTP/1.1 200 OK"), 4)

    def test_clients_that_do_not_read_lose_their_connection(self):
        job = self.web_job()
        url = f"/v1/{job}/view?pose.camera=a.png&settings.width=1600&settings.format=PICTURE_FORMAT_RAW_FLOAT"
        request = f"GET {url} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
        lazy = []
        for _ in range(8):
            connection = socket.socket()
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            connection.connect(("127.0.0.1", self.server.web_port))
            connection.sendall(request)
            lazy.append(connection)
            self.addCleanup(connection.close)
        # They hold no thread: others are served.
        self.assertEqual(self.web.get("/v1/jobs").code, 200)

        def cut():
            log = pathlib.Path(self.server.log_path).read_text()
            return "does not read its answer" in log
        self.wait_for(cut, "an end of their connections")

    def test_ten_thousand_requests(self):
        def some(_):
            web = self.client()
            return [web.get("/v1/jobs").code for _ in range(500)]
        with concurrent.futures.ThreadPoolExecutor(20) as pool:
            codes = [code for codes in pool.map(some, range(20)) for code in codes]
        self.assertEqual((len(codes), set(codes)), (10000, {200}))

    def test_more_connections_than_there_is_room_for(self):
        for _ in range(60):
            self.raw(b"GET /")
        self.assertEqual(self.client().get("/v1/jobs").code, 200)


class Tls(GatewayTest):

    @classmethod
    def make_server(cls):
        cert, key = f"{cls.class_folder}/cert.pem", f"{cls.class_folder}/key.pem"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2",
                        "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1",
                        "-keyout", key, "-out", cert], check=True, capture_output=True)
        cls.context = ssl.create_default_context(cafile=cert)
        return gateway.WebServer(cls.class_folder, extra=("--tls-cert", cert, "--tls-key", key))

    def setUp(self):
        super().setUp()
        self.web = self.client(context=self.context)

    def test_calls_and_events(self):
        job = self.web.post("/v1/jobs").json()["name"]
        for seed, name in enumerate(PHOTOS):
            self.assertEqual(self.web.put_file(job, name, harness.large_png(seed, 300, 200)).code, 200)
        self.web.post(f"/v1/{job}:start")
        self.web.post(f"/v1/{job}:cancel")
        self.assertEqual(list(self.web.events(f"/v1/{job}/events"))[-1][0], "end")
        cookie = self.web.post("/v1/session", {"token": "any"}).headers.get("Set-Cookie", "Secure")
        self.assertIn("Secure", cookie)

    def test_plaintext_is_no_request(self):
        with contextlib.suppress(ConnectionResetError, gateway.http.client.HTTPException):
            gateway.Client(self.server.web_port).get("/")
            self.fail("plaintext was answered")
        self.assertEqual(self.web.get("/").code, 200)


class Starting(unittest.TestCase):

    def refused(self, *flags):
        with tempfile.TemporaryDirectory() as folder:
            run = subprocess.run(
                [f"{harness.BIN}/{harness.SERVER_PROGRAM}", "--listen", "127.0.0.1:0", "--data",
                 folder, *flags], capture_output=True, text=True, timeout=harness.PATIENCE_S)
            self.assertEqual(run.returncode, 1)
            return run.stderr

    def test_addresses_that_others_reach(self):
        self.assertIn("unencrypted", self.refused("--web", "0.0.0.0:0"))

    def test_an_address_that_is_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            said = self.refused("--web", "127.0.0.1:%d" % taken.getsockname()[1])
            self.assertIn("choose another --web", said)

    def test_it_ends_while_clients_are_there(self):
        with tempfile.TemporaryDirectory() as folder:
            server = gateway.WebServer(folder)
            web = gateway.Client(server.web_port)
            self.addCleanup(web.connection.close)
            job = web.post("/v1/jobs").json()["name"]
            events = web.events(f"/v1/{job}/events")
            next(events)
            idle = gateway.Client(server.web_port)
            self.addCleanup(idle.connection.close)
            idle.get("/")
            began = time.monotonic()
            self.assertEqual(server.stop(), 0)
            self.assertLess(time.monotonic() - began, 20)
            with contextlib.suppress(gateway.http.client.HTTPException, ConnectionError):
                list(events)


if __name__ == "__main__":
    unittest.main(verbosity=2)
