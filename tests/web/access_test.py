"""Who may call the page's gateway, and what it takes from those who may not."""

import concurrent.futures
import contextlib
import json
import pathlib
import re
import socket
import ssl
import subprocess
import tempfile
import time
import unittest

import gateway
import certificates
import harness
from gateway import GatewayTest, PHOTOS
from harness import rpc


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
        for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "unix",
                     "unix:80", "unix-abstract:80"):
            self.assert_fails(self.web.get("/v1/jobs", headers={"Host": host}), 403,
                              "HOST_NOT_LOCAL")
        for host in ("localhost", "localhost:8080", "127.0.0.1", "[::1]:80"):
            self.assertEqual(self.web.get("/v1/jobs", headers={"Host": host}).code, 200)


    def calls_in_log(self, request_id):
        log = pathlib.Path(self.server.log_path).read_text()
        return re.findall(rf"call=(\w+) request={request_id} client=\S+ peer=(\S+)", log)

    def test_a_call_is_found_in_the_log_by_its_answer(self):
        reply = self.web.post("/v1/jobs", {}, headers={"X-Request-Id": "trace-7f.3"})
        self.assertEqual(reply.headers["X-Request-Id"], "trace-7f.3")
        host, port = self.web.connection.sock.getsockname()
        self.wait_for(lambda: self.calls_in_log("trace-7f.3") == [("CreateJob", f"{host}:{port}")],
                      "the line of the call")
        for headers in ({}, {"X-Request-Id": "two words"}):
            reply = self.web.post("/v1/jobs", {}, headers=headers)
            self.assertRegex(reply.headers["X-Request-Id"], "^[0-9a-f]{16}$")

    def test_who_calls_by_grpc_cannot_name_another(self):
        metadata = [("x-request-id", "forged"), ("litags-peer", "192.0.2.7:1")]
        self.jobs.CreateJob(rpc.CreateJobRequest(), metadata=metadata)
        self.wait_for(lambda: self.calls_in_log("forged"), "the line of the call")
        self.assertTrue(self.calls_in_log("forged")[0][1].startswith("127.0.0.1:"))


class TokenTest(GatewayTest):
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
        return gateway.WebServer(cls.class_folder, extra=("--token", ",".join(entries), *cls.extra))

    def log_in(self, name, headers=None):
        """The cookie, as a browser would send it."""
        reply = self.web.post("/v1/session", {"token": self.tokens[name]}, headers=headers)
        self.assertEqual(reply.code, 200, reply.body)
        cookie = reply.headers["Set-Cookie"]
        self.assertIn("HttpOnly", cookie)
        self.assertIn("SameSite=Strict", cookie)
        return {"Cookie": "theme=dark; " + cookie.split(";")[0]}


class Tokens(TokenTest):

    def test_wrong_and_missing_tokens(self):
        cookie = f"litags_token_{self.server.web_port}"
        for headers in ({}, {"Authorization": "Bearer wrong"}, {"Cookie": f"{cookie}=wrong"},
                        {"Cookie": f"{cookie}="}, {"Cookie": f"=;;{cookie}"}):
            reply = self.web.get("/v1/jobs", headers=headers)
            self.assert_fails(reply, 401, "TOKEN_MISSING|TOKEN_INVALID")
        for body in ({"token": "wrong"}, {"token": ""}, {"token": 3}, {"token": "a\r\nSet-Cookie: x"},
                     {}, "no json"):
            reply = self.web.call("POST", "/v1/session", body if isinstance(body, str)
                                  else json.dumps(body))
            self.assertEqual(reply.code, 401, reply.body)
            self.assertNotIn("Set-Cookie", reply.headers)

    def test_sessions_of_two_servers_on_one_host(self):
        other = {"Host": "127.0.0.1:1"}
        cookies = {"Cookie": "; ".join((self.log_in("bob", other)["Cookie"],
                                        self.log_in("alice")["Cookie"]))}
        for headers, name in ((cookies, "alice"), ({**cookies, **other}, "bob")):
            info = self.web.get("/v1/serverInfo", headers=headers).json()
            self.assertEqual(info["client"]["name"], name)

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
            for path in (job["name"], f"{job['name']}/report"):
                self.assert_fails(self.web.get(f"/v1/{path}", headers=headers), 404,
                                  "JOB_NOT_FOUND")
            self.assertEqual(self.web.get("/v1/jobs", headers=headers).json().get("jobs", []), [])

    def test_tokens_free_the_name_of_the_machine(self):
        host = {"Host": "photos.example"}
        alice = {**self.log_in("alice", host), **host}
        self.assertEqual(self.web.get("/v1/jobs", headers=alice).code, 200)

    def test_strangers_bytes_are_not_taken(self):
        self.assert_fails(self.web.put_file("jobs/0none", "x.png", bytes(1 << 20)), 401, "TOKEN_MISSING")


class Strangers(TokenTest):
    """A connection has seconds for a call that is let in."""

    extra = ("--max-first-call", str(4 * harness.SLOWER))

    def stranger(self, request):
        connection = socket.create_connection(("127.0.0.1", self.server.web_port))
        self.addCleanup(connection.close)
        connection.sendall(f"{request} HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n".encode())
        return connection

    def test_strangers_are_cut_whatever_they_ask(self):
        strangers = [self.stranger(request) for request in (
            "PUT /v1/jobs/%ff/files/x.png", "PUT /v1/jobs/0none/files/x.png", "GET /v1/jobs",
            "GET /v1/jobs/0none/events", "GET /v1/jobs/0none/model")]
        self.wait_for(lambda: harness.closed(strangers) == len(strangers), "an end of them all")

    def test_a_client_stays_whose_first_call_is_quiet(self):
        alice = self.log_in("alice")
        job = self.web.post("/v1/jobs", {}, headers=alice).json()["name"]
        connection = self.client().connection
        connection.request("GET", f"/v1/{job}/events?afterEvent=1", headers=alice)
        events = connection.getresponse()
        later = [self.stranger("GET /v1/jobs")]
        self.wait_for(lambda: harness.closed(later), "an end of who came later")
        self.assertEqual(self.web.call("DELETE", f"/v1/{job}", headers=alice).code, 200)
        self.assertIn(b"event: failure", events.read())


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
            self.assertTrue(b"\r\nx-request-id: " in said.lower() or not said, (text, said))
        said = self.answer(b"GET / HTTP/1.1\r\nX: " + b"y" * 20000 + b"\r\n\r\n")
        self.assertTrue(said.startswith(b"HTTP/1.1 431"), said[:200])
        self.assertIn(b"HEADERS_TOO_LARGE", said)
        self.assertIn(b"\r\nx-request-id: ", said.lower())
        self.assertEqual(self.web.get("/v1/jobs").code, 200)

    def test_a_body_that_stops(self):
        said = self.answer(b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\n\r\n{")
        self.assertTrue(said.startswith(b"HTTP/1.1 504"), said[:200])
        self.assertIn(b"UPLOAD_STALLED", said)

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
        sockets = [self.raw(b"GET /") for _ in range(60)]
        self.assertEqual(self.client().get("/v1/jobs").code, 200)
        # One network may have half of the 40; we also are the client above.
        self.wait_for(lambda: harness.closed(sockets) >= 40, "an end of those beyond the room")
        self.assertLess(harness.closed(sockets), 50)


class Tls(GatewayTest):

    @classmethod
    def make_server(cls):
        tls = certificates.make(cls.class_folder)
        cls.context = ssl.create_default_context(cafile=f"{cls.class_folder}/ca.crt")
        return gateway.WebServer(cls.class_folder, extra=tls)

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
        cookie = self.web.call("DELETE", "/v1/session").headers["Set-Cookie"]
        self.assertIn("; Secure", cookie)

    def test_plaintext_is_no_request(self):
        with contextlib.suppress(ConnectionResetError, gateway.http.client.HTTPException):
            gateway.Client(self.server.web_port).get("/")
            self.fail("plaintext was answered")
        self.assertEqual(self.web.get("/").code, 200)


class TlsFiles(GatewayTest):
    """Certificates of an authority: broken ones on the disk, and browsers that show theirs."""

    @classmethod
    def make_server(cls):
        cls.pems = pathlib.Path(cls.class_folder)
        tls = certificates.make(cls.class_folder)
        certificates.issue(cls.class_folder, "client")
        made = subprocess.run([f"{harness.BIN}/{harness.SERVER_PROGRAM}", "token", "alice"],
                              capture_output=True, text=True, check=True)
        cls.flags = (*tls, "--tls-client-ca", str(cls.pems / "ca.crt"), "--token",
                     made.stderr.split("--token ")[1].strip())
        return gateway.WebServer(cls.class_folder, extra=cls.flags)

    def browser(self):
        context = ssl.create_default_context(cafile=self.pems / "ca.crt")
        context.load_cert_chain(self.pems / "client.crt", self.pems / "client.key")
        return context

    def request(self, context, session=None):
        """The answer's first line, and the TLS session with which the next connection may begin."""
        with socket.create_connection(("127.0.0.1", self.server.web_port)) as plain:
            plain.settimeout(harness.PATIENCE_S)
            with context.wrap_socket(plain, server_hostname="127.0.0.1", session=session) as tls:
                tls.sendall(b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
                said = tls.recv(4096)
                self.assertEqual(tls.session_reused, session is not None)
                return said.split(b"\r\n")[0], tls.session

    def test_sessions_are_resumed(self):
        for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):
            context = self.browser()
            context.minimum_version = context.maximum_version = version
            said, session = self.request(context)
            self.assertEqual(said, b"HTTP/1.1 200 OK")
            said, _ = self.request(context, session)
            self.assertEqual(said, b"HTTP/1.1 200 OK")

    def test_a_broken_renewal_changes_nothing(self):
        context = self.browser()
        cert = self.pems / "server.crt"
        whole = cert.read_text()

        def said(words):
            self.assertEqual(self.request(context)[0], b"HTTP/1.1 200 OK")
            return words in pathlib.Path(self.server.log_path).read_text()

        def restore():  # renewals end sessions: the next test must not meet this one
            cert.write_text(whole)
            self.wait_for(lambda: said("TLS files were renewed"), "a look at the whole files")
        self.addCleanup(restore)
        # The server's own certificate is whole, that of its issuer is not.
        cert.write_text(whole + (self.pems / "ca.crt").read_text()[:500])

        self.wait_for(lambda: said("TLS stays as it was"), "a look at the files")
        self.assertEqual(self.request(context)[0], b"HTTP/1.1 200 OK")
        with tempfile.TemporaryDirectory() as folder:
            run = subprocess.run(
                [f"{harness.BIN}/{harness.SERVER_PROGRAM}", "--listen", "127.0.0.1:0", "--web",
                 "127.0.0.1:0", "--data", folder, *self.flags],
                capture_output=True, text=True, timeout=harness.PATIENCE_S)
        self.assertEqual(run.returncode, 1)
        self.assertIn("certificate 2 of", run.stderr)


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

    def test_a_server_that_knows_clients_by_certificates_alone(self):
        with tempfile.TemporaryDirectory() as folder:
            tls = certificates.make(folder)
            self.assertIn("WEB_NEEDS_TOKENS", self.refused(
                *tls, "--tls-client-ca", f"{folder}/ca.crt", "--web", "127.0.0.1:0"))

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
            server.stop()
            self.assertLess(time.monotonic() - began, 20)
            with contextlib.suppress(gateway.http.client.HTTPException, ConnectionError):
                list(events)


if __name__ == "__main__":
    unittest.main(verbosity=2)
