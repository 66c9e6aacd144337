"""A server with its page's port, and HTTP calls to it, for the tests of server/web."""

import base64
import hashlib
import http.client
import json
import os
import pathlib
import sys
import urllib.parse

sys.path.insert(0, str(pathlib.Path(os.environ["LITAGS_SOURCE"], "tests/service")))
import harness  # noqa: E402
from litags.v1 import model_service_pb2, render_service_pb2  # noqa: E402

PHOTOS = ("a.png", "b.png", "c.png")


def messages():
    """What services answer with, as JSON: {message: {field: its message, its values or ""}}."""
    found = {}

    def kind_of(field):
        if field.enum_type:
            return [value.name for value in field.enum_type.values]
        message = field.message_type
        if not message or message.GetOptions().map_entry or message.file.package != "litags.v1":
            return ""
        add(message)
        return message.name

    def add(message):
        if message.name not in found:
            found[message.name] = {}
            found[message.name].update((field.json_name, kind_of(field)) for field in message.fields)

    for part in (harness.rpc, model_service_pb2, render_service_pb2):
        for service in part.DESCRIPTOR.services_by_name.values():
            for method in service.methods:
                add(method.output_type)
    return json.dumps(found)


class WebServer(harness.Server):
    """harness.Server with --web; `web_port` 0: any free one."""

    def __init__(self, folder, web_port=0, host="127.0.0.1", extra=(), **more):
        port_file = pathlib.Path(folder, "web-port")
        port_file.unlink(missing_ok=True)
        super().__init__(folder, extra=("--web", f"{host}:{web_port}", "--web-port-file",
                                        str(port_file), *extra), **more)
        self.web_port = int(port_file.read_text())


class Reply:
    """Code, headers and body of an answer."""

    def __init__(self, response):
        self.code = response.status
        self.headers = response.headers
        self.body = response.read()

    def json(self):
        return json.loads(self.body)

    def detail(self, kind):
        """The detail of that type in a google.rpc.Status; {} if there is none."""
        return next((d for d in self.json()["details"] if d["@type"].endswith("/" + kind)), {})

    def reason(self):
        """The reason in a google.rpc.Status."""
        return self.detail("litags.v1.ErrorDetail").get("reason")


class Client:
    """Calls over one connection that is kept."""

    def __init__(self, port, headers=None, context=None, host="127.0.0.1"):
        self.headers = headers or {}
        self.connection = (
            http.client.HTTPSConnection(host, port, timeout=harness.PATIENCE_S, context=context)
            if context else http.client.HTTPConnection(host, port, timeout=harness.PATIENCE_S))

    def call(self, method, path, body=None, headers=None):
        if isinstance(body, dict):
            body = json.dumps(body)
        self.connection.request(method, path, body, {**self.headers, **(headers or {})})
        return Reply(self.connection.getresponse())

    def get(self, path, **more):
        return self.call("GET", path, **more)

    def post(self, path, body=None, **more):
        return self.call("POST", path, {} if body is None else body, **more)

    def put_file(self, job, name, data, first=0, end=None, role=None):
        """Sends bytes first..end of a file; none if first is its size."""
        end = len(data) if end is None else end
        digest = base64.b64encode(hashlib.sha256(data).digest()).decode()
        headers = {"Repr-Digest": f"sha-256=:{digest}:"}
        if first == len(data):
            headers["Content-Range"] = f"bytes */{first}"
        elif (first, end) != (0, len(data)):
            headers["Content-Range"] = f"bytes {first}-{end - 1}/{len(data)}"
        path = f"/v1/{job}/files/{urllib.parse.quote(name, safe='')}"
        return self.call("PUT", path + (f"?role={role}" if role else ""), data[first:end], headers)

    def events(self, path, headers=None):
        """The server-sent events of a stream until its end, as (name, id, data)."""
        self.connection.request("GET", path, headers={**self.headers, **(headers or {})})
        response = self.connection.getresponse()
        assert response.status == 200, response.read()
        name, number, data = "message", None, ""
        for line in response:
            key, _, value = line.decode().rstrip("\n").partition(": ")
            if key == "event":
                name = value
            elif key == "id":
                number = int(value)
            elif key == "data":
                data = value
            elif not line.strip() and data:
                yield name, number, json.loads(data)
                name, number, data = "message", None, ""


class GatewayTest(harness.ServiceTest):
    """One server without tokens."""

    extra = ()

    @classmethod
    def make_server(cls):
        return WebServer(cls.class_folder, extra=cls.extra)

    def setUp(self):
        super().setUp()
        self.web = self.client()

    def client(self, **more):
        """One more connection."""
        client = Client(self.server.web_port, **more)
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
        self.assertRegex(reply.reason(), f"^({reason})$")
        self.assertRegex(reply.json()["message"], words)
