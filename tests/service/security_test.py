"""TLS, tokens and settings as operators and clients use them: real programs, real sockets."""

import json
import os
import re
import shutil
import ssl
import subprocess
import tempfile
import unittest

import certificates
import harness
from harness import BIN, SERVER_PROGRAM

SERVER = os.path.join(BIN, SERVER_PROGRAM)


def run_server(*args, env=None):
    """A run of the server's program that ends by itself; returns (code, stdout, stderr)."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("LITAGS_SERVER_")}
    done = subprocess.run([SERVER, *args], env=dict(environment, **(env or {})), text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          timeout=harness.PATIENCE_S)
    return done.returncode, done.stdout, done.stderr


class Security(harness.ServiceTest):

    @classmethod
    def setUpClass(cls):
        cls.class_folder = tempfile.mkdtemp(prefix="litags-security-")
        cls.addClassCleanup(shutil.rmtree, cls.class_folder, ignore_errors=True)
        at = lambda name: os.path.join(cls.class_folder, name)  # noqa: E731
        tls = certificates.make(cls.class_folder)
        cls.tokens, cls.token_of = at("tokens"), {}
        for name in ("alice", "bob", "root"):
            code, out, _ = run_server("token", name, "--tokens", cls.tokens)
            assert code == 0
            cls.token_of[name] = out.strip()
            with open(at(name + ".token"), "w") as file:
                file.write(out)
        cls.server = harness.Server(
            cls.class_folder, extra=(*tls, "--tokens", cls.tokens, "--admins", "root",
                                     "--log-level", "debug", "--log-format", "json"))
        cls.addClassCleanup(lambda: cls.server.stop())

    def litags_as(self, client, *args, exit_code=0):
        access = ("--tls-ca", os.path.join(self.class_folder, "ca.crt"))
        if client:
            access += ("--token-file", os.path.join(self.class_folder, client + ".token"))
        return self.litags(*access, *args, exit_code=exit_code)

    def test_a_job_is_its_owners_alone(self):
        out, _ = self.litags_as("alice", "submit", self.photos(), "--watch", "--iterations", "20")
        job = out.strip()
        picture = os.path.join(self.folder, "view.png")
        self.litags_as("alice", "render", job, "--camera", "a.png", "-o", picture)
        self.assertTrue(os.path.exists(picture))
        self.assertIn(job, self.litags_as("alice", "list")[0])
        self.assertNotIn(job, self.litags_as("bob", "list")[0])
        self.assertIn(job, self.litags_as("root", "list")[0])
        for command in (("show", job), ("watch", job), ("cancel", job), ("resume", job),
                        ("delete", job), ("cameras", job),
                        ("render", job, "--camera", "a.png", "-o", picture + ".png")):
            _, err = self.litags_as("bob", *command, exit_code=4)
            self.assertIn("JOB_NOT_FOUND", err, command)
        self.litags_as("root", "delete", job)

    def test_a_renewed_certificate_is_shown_and_nothing_is_interrupted(self):
        def shown():
            return ssl.get_server_certificate(("127.0.0.1", self.server.port))

        out, _ = self.litags_as("alice", "submit", self.photos(("slow.png", "b.png", "c.png")),
                                "--iterations", "100000")
        job, before = out.strip(), shown()
        with open(os.path.join(self.class_folder, "server.crt")) as file:
            self.assertEqual(file.read().strip(), before.strip())
        watch = self.start_litags(
            "--retry", "0", "--tls-ca", os.path.join(self.class_folder, "ca.crt"), "--token-file",
            os.path.join(self.class_folder, "alice.token"), "watch", job)
        watch.stdout.readline()  # it is connected
        certificates.issue(self.class_folder, "server")
        self.wait_for(lambda: shown() != before, "the renewed certificate")
        with open(os.path.join(self.class_folder, "server.crt")) as file:
            self.assertEqual(file.read().strip(), shown().strip())
        self.litags_as("alice", "list")  # a new connection
        self.assertIsNone(watch.poll())
        self.litags_as("alice", "cancel", job)
        out, err = watch.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(watch.returncode, 1, err)
        self.assertIn("is cancelled", out)

    def test_nobody_gets_in_without_a_token(self):
        _, err = self.litags_as(None, "list", exit_code=5)
        self.assertRegex(err, r"UNAUTHENTICATED TOKEN_MISSING")
        # But a probe may ask for health.
        out, _ = self.litags_as(None, "doctor", exit_code=5)
        self.assertRegex(out, r"health +serving")

    def test_the_token_may_be_in_the_environment(self):
        os.environ["LITAGS_TOKEN"] = self.token_of["alice"]
        self.addCleanup(os.environ.pop, "LITAGS_TOKEN")
        self.litags_as(None, "list")

    def test_plaintext_is_told_from_no_server(self):
        _, err = self.litags("list", exit_code=3)
        self.assertIn("--tls", err)

    def test_a_token_is_not_sent_unencrypted_to_another_machine(self):
        _, err = self.litags("--server", "192.0.2.1:1", "--token-file",
                             os.path.join(self.class_folder, "alice.token"), "list", exit_code=2)
        self.assertIn("TOKEN_EXPOSED", err)

    def test_logs_and_files_hold_no_token(self):
        self.litags_as("alice", "list")
        wrong = os.path.join(self.folder, "wrong.token")
        with open(wrong, "w") as file:
            file.write("litags_" + "5" * 64)
        self.litags("--tls-ca", os.path.join(self.class_folder, "ca.crt"), "--token-file", wrong,
                    "list", exit_code=5)
        paths = [self.tokens, self.server.log_path]
        for folder, _, names in os.walk(self.server.data):
            paths += [os.path.join(folder, name) for name in names]
        secrets = [token.removeprefix("litags_").encode() for token in self.token_of.values()]
        for path in paths:
            with open(path, "rb") as file:
                data = file.read()
            for secret in secrets + [b"5" * 64]:
                self.assertNotIn(secret, data, path)

    def test_logs_are_objects_with_job_and_request(self):
        job, _ = self.litags_as("alice", "submit", self.photos(), "--watch", "--iterations", "5")
        calls, jobs = [], set()
        with open(self.server.log_path) as file:
            for line in file:
                if not line.startswith("{"):
                    self.assertIn("litags-server listens", line)
                    continue
                event = json.loads(line)
                self.assertRegex(event["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$")
                if "call" in event:
                    calls.append(event)
                jobs.add(event.get("job"))
        created = [event for event in calls if event["call"] == "CreateJob"]
        self.assertTrue(created)
        self.assertEqual(created[-1]["client"], "alice")
        self.assertRegex(created[-1]["request"], r"^[0-9a-f]{16}$")
        self.assertIn(job.strip().removeprefix("jobs/"), jobs)


class Settings(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="litags-settings-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.data = os.path.join(self.folder, "data")

    def write(self, text):
        path = os.path.join(self.folder, "server.toml")
        with open(path, "w") as file:
            file.write(text)
        return path

    def test_one_precedence_printed_with_its_sources(self):
        path = self.write('max-jobs = 3\nworkers = 4\nthreads = 5\nlog-format = "json"\n')
        code, out, err = run_server(
            "--config", path, "--threads", "9", "--token", "a:sha256:" + "ab" * 32,
            "--print-config", env={"LITAGS_SERVER_WORKERS": "8", "LITAGS_DATA": self.data})
        self.assertEqual(code, 0, err)
        self.assertIn(f"max-jobs = 3  # file {path}\n", out)
        self.assertIn("workers = 8  # environment LITAGS_SERVER_WORKERS\n", out)
        self.assertIn("threads = 9  # command line\n", out)
        self.assertIn(f'data = "{self.data}"  # environment LITAGS_DATA\n', out)
        self.assertIn("render-workers = 2  # default\n", out)
        self.assertNotIn("abab", out + err)
        # What it prints is a file that says the same.
        again = self.write(out)
        code, printed, err = run_server("--config", again, "--print-config")
        self.assertEqual(code, 0, err)
        values = lambda text: re.findall(r"(?m)^(\S+ = .*?)  # ", text)  # noqa: E731
        self.assertEqual(values(printed), values(out))

    def test_mistakes_end_the_start_with_their_place(self):
        for text, words in (("max-jobz = 3\n", "max-jobz"), ("workers = 1000\n", "--workers"),
                            ("[server]\nworkers = 1\n", "server"),
                            ('listen = ""\n', "--listen")):
            code, _, err = run_server("--config", self.write(text))
            self.assertEqual(code, 2)
            self.assertIn(words, err)

    def test_settings_that_do_nothing_without_another_are_refused(self):
        for text, other in (('web-port-file = "web-port"', "--web;"),
                            ("metrics-for-all = true", "--metrics-listen"),
                            ("webhook-internal = true", "--webhook-hosts"),
                            ('webhook-ca = "ca.crt"', "--webhook-hosts"),
                            ('admins = ["root"]', "--tokens")):
            for check in ((), ("--check",)):
                code, _, err = run_server("--data", self.data, "--config", self.write(text), *check)
                self.assertEqual(code, 2, err)
                self.assertIn(f"--{text.split()[0]} does nothing without {other}", err)
        code, _, err = run_server("--data", self.data, "--s3-endpoint", "http://s3:7070")
        self.assertEqual(code, 1, err)
        self.assertIn("--blobs s3://", err)
        code, _, err = run_server("--check", "--print-config")
        self.assertEqual(code, 2, err)

    def test_hosts_and_certificates_of_webhooks_are_read_at_the_start(self):
        for args, words in ((("--webhook-hosts", "https://hooks.example.com"), "without https://"),
                            (("--webhook-hosts", "*", "--webhook-ca", "/missing.pem"),
                             "/missing.pem")):
            for check in ((), ("--check",)):
                code, out, err = run_server("--listen", "127.0.0.1:0", "--data", self.data, *args,
                                            *check)
                self.assertEqual(code, 1, out + err)
                self.assertIn(words, out + err)

    def test_others_are_not_let_in_by_accident(self):
        for args, words in ((("--listen", "0.0.0.0:0"), "--insecure"),
                            (("--listen", "127.0.0.1:0", "--metrics-listen", "0.0.0.0:0"),
                             "--metrics-for-all"),
                            (("--listen", "0.0.0.0:0", "--metrics-listen", "127.0.0.1:0",
                              "--metrics-for-all"), "--insecure"),
                            (("--listen", "127.0.0.1:0", "--tls-cert", "/missing"), "--tls-key"),
                            (("--listen", "127.0.0.1:0", "--tls-cert", "/missing", "--tls-key",
                              "/missing"), "/missing"),
                            (("--listen", "127.0.0.1:0", "--tokens", "/missing"), "/missing")):
            code, _, err = run_server("--data", self.data, *args)
            self.assertEqual(code, 1, err)
            self.assertIn(words, err)

    def test_check_tells_line_by_line_what_is_missing(self):
        colmap = os.path.join(self.folder, "colmap")
        with open(colmap, "w") as file:
            file.write("#!/bin/sh\necho 'COLMAP 3.8 (a fake)'\n")
        os.chmod(colmap, 0o755)
        code, out, err = run_server("--check", "--data", self.data, "--colmap", colmap)
        self.assertEqual(code, 0, out + err)
        self.assertRegex(out, r"(?m)^ok +store ")
        self.assertRegex(out, r"(?m)^ok +space +\d+ MiB free")
        self.assertRegex(out, r"(?m)^ok +colmap +COLMAP 3\.8")
        self.assertRegex(out, r"(?m)^(ok|note) +confinement ")
        code, out, _ = run_server("--check", "--data", self.data, "--colmap", "/missing/colmap",
                                  "--tls-cert", "/missing", "--tls-key", "/missing")
        self.assertEqual(code, 1)
        self.assertRegex(out, r"(?m)^FAIL +colmap .*/missing/colmap")
        self.assertRegex(out, r"(?m)^FAIL +tls .*/missing.* \(TLS_FILE_UNREADABLE\)$")
        self.assertRegex(out, r"(?m)^ok +store ")

    def test_check_looks_into_stores_elsewhere(self):
        for option, value, words in (
                ("--store", "postgresql://u:secret@127.0.0.1:1/jobs", "database is away"),
                ("--store", "redis://127.0.0.1", "neither"),
                ("--blobs", "ftp://127.0.0.1", "neither")):
            code, out, err = run_server("--check", "--data", self.data, option, value)
            self.assertEqual(code, 1)
            self.assertRegex(out, "(?m)^FAIL +store .*" + words)
            self.assertNotIn("secret", out + err)

    def test_check_tells_of_blobs_of_another_installation_and_marks_none(self):
        markers = os.path.join(self.folder, "blobs", "installation")
        other = os.path.join(markers, "0123456789abcdef" * 2)
        os.makedirs(markers)
        with open(other, "w", encoding="utf-8"):
            pass
        flags = ("--check", "--data", self.data, "--blobs", f"file://{self.folder}/blobs")
        code, out, _ = run_server(*flags)
        self.assertEqual(code, 1)
        self.assertRegex(out, "(?m)^FAIL +store .*belongs to another installation, 0123456789abcdef")
        os.remove(other)
        self.assertRegex(run_server(*flags)[1], r"(?m)^ok +store ")
        self.assertEqual(os.listdir(markers), [])

    def test_check_of_a_folder_that_cannot_be_one_fails(self):
        code, out, _ = run_server("--check", "--data", self.write("not a folder"), "--colmap",
                                  "/bin/true")
        self.assertEqual(code, 1)
        self.assertRegex(out, r"(?m)^FAIL +store ")

    def test_tokens_are_made_and_only_their_digest_is_kept(self):
        tokens = os.path.join(self.folder, "tokens")
        code, out, err = run_server("token", "alice", "--tokens", tokens)
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"^litags_[0-9a-f]{64}\n$")
        with open(tokens) as file:
            self.assertRegex(file.read(), r"^alice:sha256:[0-9a-f]{64}\n$")
        self.assertEqual(os.stat(tokens).st_mode & 0o777, 0o600)
        code, out, err = run_server("token", "bob")
        self.assertEqual(code, 0)
        self.assertRegex(err, r"--token bob:sha256:[0-9a-f]{64}")
        self.assertNotEqual(run_server("token", "a/b")[0], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
