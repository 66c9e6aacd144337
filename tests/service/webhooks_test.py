"""A receiver of webhooks: told once of each end, signed, also when it was away."""

import http.server
import json
import os
import re
import ssl
import threading
import unittest
from unittest import mock

import certificates
import examples
import harness
from harness import rpc


def function_of_page():
    """The function that docs/webhooks.md gives to receivers."""
    page = (examples.SOURCE / "docs/webhooks.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], names)
    return names["is_genuine"]


IS_GENUINE = function_of_page()
SECRET = "0123456789abcdef0123456789abcdef"


class Receiver(http.server.ThreadingHTTPServer):
    """Keeps what it is told; answers with 503 as often as `busy` says. Speaks TLS if `certificates`
    names a folder that holds server.crt and server.key."""

    def __init__(self, certificates=None):
        super().__init__(("127.0.0.1", 0), Handler)
        self.told, self.busy = [], 0
        self.scheme = "https" if certificates else "http"
        if certificates:
            tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            tls.load_cert_chain(os.path.join(certificates, "server.crt"),
                                os.path.join(certificates, "server.key"))
            self.socket = tls.wrap_socket(self.socket, server_side=True)
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self):
        return f"{self.scheme}://127.0.0.1:{self.server_port}/hook"

    def handle_error(self, request, client_address):
        """Says nothing: a peer that does not trust the certificate goes away."""


class Handler(http.server.BaseHTTPRequestHandler):

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.told.append((dict(self.headers), body))
        answer = 503 if self.server.busy > 0 else 200
        self.server.busy -= 1
        self.send_response(answer)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_):
        pass


class Webhooks(harness.ServiceTest):
    @classmethod
    def make_server(cls):
        return harness.Server(cls.class_folder,
                              extra=("--webhook-hosts", "127.0.0.1", "--webhook-internal"))

    def setUp(self):
        super().setUp()
        self.receiver = Receiver()
        self.addCleanup(self.receiver.server_close)
        self.addCleanup(self.receiver.shutdown)

    def job(self, name):
        return self.jobs.GetJob(rpc.GetJobRequest(name=name))

    def told(self, count):
        self.wait_for(lambda: len(self.receiver.told) >= count, f"told {count} times")
        return self.receiver.told[count - 1]

    def test_an_end_is_told_with_the_job_and_its_signature(self):
        out, _ = self.litags("submit", self.photos(), "--iterations", "20", "--label", "site=north",
                             "--webhook", self.receiver.url, "--webhook-secret", SECRET)
        job = out.strip()
        headers, body = self.told(1)
        told = json.loads(body)
        self.assertEqual((told["name"], told["state"]), (job, "JOB_STATE_SUCCEEDED"))
        self.assertEqual(told["labels"], {"site": "north"})
        self.assertNotIn(SECRET, body.decode())
        self.assertTrue(IS_GENUINE(headers, body, SECRET))
        self.assertFalse(IS_GENUINE(headers, body + b" ", SECRET))
        self.assertFalse(IS_GENUINE(headers, body, SECRET[::-1]))
        self.assertFalse(IS_GENUINE(headers | {"Litags-Timestamp": "1"}, body, SECRET))
        last = self.job(job).last_event
        self.assertEqual(headers["Litags-Event"], f"{job}/{last}")
        self.wait_for(lambda: self.job(job).webhook.delivered_event == last, "the server notes it")
        self.assertEqual(self.job(job).webhook.secret, "")

    def test_a_receiver_that_fails_is_known_and_told_again(self):
        self.receiver.busy = 1
        out, _ = self.litags("submit", self.photos(), "--iterations", "20", "--webhook",
                             self.receiver.url, "--webhook-secret", SECRET)
        job = out.strip()
        self.told(1)
        self.wait_for(lambda: "503" in self.job(job).webhook.last_error, "the failure is seen")
        # The next attempt comes after half a minute: webhook_sender_test.

    def test_the_secret_of_the_environment_is_used_with_a_webhook_only(self):
        with mock.patch.dict(os.environ, LITAGS_WEBHOOK_SECRET=SECRET):
            self.submit("--iterations", "20")
            job = self.submit("--iterations", "20", "--webhook", self.receiver.url)
        headers, body = self.told(1)
        self.assertEqual(json.loads(body)["name"], job)
        self.assertTrue(IS_GENUINE(headers, body, SECRET))

    def test_other_hosts_are_refused_at_once(self):
        _, err = self.litags("submit", self.photos(), "--webhook", "https://example.com/",
                             "--webhook-secret", SECRET, exit_code=2)
        self.assertRegex(err, "WEBHOOK_NOT_ALLOWED")
        _, err = self.litags("submit", self.photos(), "--webhook", self.receiver.url, exit_code=2)
        self.assertRegex(err, "webhook.secret")


class HttpsWebhooks(harness.ServiceTest):
    """Receivers with TLS, and a server that trusts one authority: --webhook-ca."""

    @classmethod
    def make_server(cls):
        cls.trusted = os.path.join(cls.class_folder, "trusted")
        cls.strange = os.path.join(cls.class_folder, "strange")
        for folder in (cls.trusted, cls.strange):
            os.mkdir(folder)
            certificates.make(folder)
        return harness.Server(cls.class_folder, extra=(
            "--webhook-hosts", "127.0.0.1", "--webhook-internal", "--webhook-ca",
            os.path.join(cls.trusted, "ca.crt")))

    def submit_with_receiver(self, certificates):
        receiver = Receiver(certificates)
        self.addCleanup(receiver.server_close)
        self.addCleanup(receiver.shutdown)
        job = self.submit("--iterations", "20", "--webhook", receiver.url, "--webhook-secret", SECRET)
        return receiver, lambda: self.jobs.GetJob(rpc.GetJobRequest(name=job)).webhook

    def test_a_receiver_with_tls_is_told(self):
        receiver, webhook = self.submit_with_receiver(self.trusted)
        self.wait_for(lambda: webhook().delivered_event > 0, "the end is told")
        headers, body = receiver.told[0]
        self.assertTrue(IS_GENUINE(headers, body, SECRET))
        self.assertEqual((webhook().attempts, webhook().last_error), (1, ""))

    def test_a_receiver_whose_certificate_is_not_trusted_is_told_nothing(self):
        receiver, webhook = self.submit_with_receiver(self.strange)
        self.wait_for(lambda: webhook().attempts == 1, "an attempt is made")
        self.assertRegex(webhook().last_error,
                         r"certificate is not trusted \(.*issuer.*--webhook-ca")
        self.assertEqual(webhook().delivered_event, 0)
        self.assertEqual(receiver.told, [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
