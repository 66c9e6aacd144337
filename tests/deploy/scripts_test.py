"""The scripts in deploy/, with stubs in place of the programs that they call."""

import gzip
import os
import pty
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

DEPLOY = os.environ["LITAGS_DEPLOY"]
PATIENCE_S = 60


class ScriptTest(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="litags-scripts-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.stubs = self.at("stubs")
        self.environment = {**os.environ, "PATH": f"{self.stubs}:{os.environ['PATH']}"}

    def at(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, path, text):
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w") as file:
            file.write(text)
        os.chmod(path, 0o755)
        return path

    def stub(self, name, text=""):
        return self.write(os.path.join(self.stubs, name), "#!/bin/sh\n" + text)

    def run_script(self, *command):
        done = subprocess.run(command, env=self.environment, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, timeout=PATIENCE_S)
        return done.returncode, done.stdout


class Postinst(ScriptTest):

    def test_a_server_that_does_not_start_again_leaves_the_package_installed(self):
        with open(os.path.join(DEPLOY, "debian", "postinst")) as file:
            script = file.read().replace("/run/systemd/system", self.folder)
        self.stub("getent")
        self.stub("adduser", "exit 1")
        self.stub("systemctl", '[ "$1" != try-restart ]')
        code, out = self.run_script("sh", self.write(self.at("postinst"), script), "configure", "0.0")
        self.assertEqual(code, 0, out)
        self.assertIn("journalctl -u litags-server", out)


class Bootstrap(ScriptTest):
    SCRIPT = os.path.join(DEPLOY, "bootstrap")

    def setUp(self):
        super().setUp()
        # Whatever the script does, nothing of this machine is installed or asked.
        self.stub("sudo", 'exec "$@"')
        self.stub("sleep")
        for name in ("apt-get", "dpkg-query"):
            self.stub(name, "exit 1")

    def test_a_package_of_two_architectures_is_installed(self):
        # As dpkg-query does, with the end of line that it is asked for.
        self.stub("dpkg-query", 'end="${2#*\\}}"; printf "installed${end}installed${end}"')
        code, out = self.run_script(self.SCRIPT)
        self.assertEqual(code, 0, out)
        self.assertIn("packages are installed", out)

    def test_it_waits_for_who_holds_the_lists(self):
        self.stub("apt-get", f'''
            case "$*" in *update*) ;; *) exit 0 ;; esac
            echo x >> {self.folder}/tries
            [ "$(wc -l < {self.folder}/tries)" -ge 3 ] && exit 0
            echo "E: Could not get lock /var/lib/apt/lists/lock" >&2
            exit 100''')
        code, out = self.run_script(self.SCRIPT)
        self.assertEqual(code, 0, out)
        self.assertEqual(out.count("waiting"), 2)

    def test_it_does_not_wait_for_ever_nor_for_anything_else(self):
        for reason, tries in (("E: Could not get lock /var/lib/apt/lists/lock", 60),
                              ("E: no network", 1)):
            self.stub("apt-get", f'echo x >> {self.folder}/tries; echo "{reason}" >&2; exit 100')
            code, out = self.run_script(self.SCRIPT)
            self.assertNotEqual(code, 0)
            self.assertIn(reason, out)
            with open(self.at("tries")) as file:
                self.assertEqual(len(file.readlines()), tries)
            os.remove(self.at("tries"))


class ManPage(ScriptTest):
    HELP = """case "$*" in
        --help) printf 'litags: Scenes.\\n\\nUsage: litags SUBCOMMAND\\n\\nSubcommands:\\n  inspect  Says.\\n' ;;
        "inspect --help") printf 'What is used.\\nUsage: litags inspect DIR\\n'; exit $CODE ;;
        esac"""

    def test_it_is_made_only_if_every_command_has_help(self):
        page = self.at("man", "litags.1.gz")
        self.stub("litags", self.HELP)
        for status, made in (("2", False), ("0", True)):
            self.environment["CODE"] = status
            code, out = self.run_script(os.path.join(DEPLOY, "cmake", "man_page.sh"),
                                        os.path.join(self.stubs, "litags"), "1.0", page)
            self.assertEqual((code == 0, os.path.exists(page)), (made, made), out)
        with gzip.open(page, "rt") as file:
            self.assertIn(".SH COMMAND INSPECT\nWhat is used.\n", file.read())


class Quickstart(ScriptTest):
    SERVER = """#!{python} -B
import http.server, os, sys
if any(name.startswith("LITAGS_") for name in os.environ):
    sys.exit("a setting of another server")
os.chdir("{page}")
server = http.server.HTTPServer(("127.0.0.1", 0), http.server.SimpleHTTPRequestHandler)
for flag, port in (("--web-port-file", server.server_port), ("--port-file", 1)):
    with open(sys.argv[sys.argv.index(flag) + 1], "w") as file:
        print(port, file=file)
server.serve_forever()
"""

    def setUp(self):
        super().setUp()
        # A checkout of stubs: a server that is there until it is stopped, and programs that do nothing.
        self.script = self.write(self.at("root", "deploy", "quickstart"), "")
        shutil.copy(os.path.join(DEPLOY, "quickstart"), self.script)
        self.write(self.at("root", "deploy", "bootstrap"), "#!/bin/sh\n")
        for name in ("cmake", "npm", "node"):
            self.stub(name)
        for name in ("litags", "litags-sample", "litags-sheet"):
            self.write(self.at("root", "build", "release", "bin", name), "#!/bin/sh\necho jobs/1\n")
        os.mkdir(self.at("page"))
        self.serve_page("index.html")
        self.write(self.at("root", "build", "release", "bin", "litags-server"),
                   self.SERVER.format(python=sys.executable, page=self.at("page")))

    def serve_page(self, name):
        """The server's page is this file of its source."""
        shutil.copy(os.path.join(os.path.dirname(DEPLOY), "server", "web", "app", name),
                    self.at("page", "index.html"))

    def on_terminal(self, key):
        """Runs it on a terminal where `key` is pressed at the end; returns (code, what it said)."""
        pid, terminal = pty.fork()
        if pid == 0:
            os.chdir(self.at("root"))
            os.execve("/bin/bash", ["bash", "deploy/quickstart", self.at("out")], self.environment)
        said = b""
        end = time.monotonic() + PATIENCE_S
        try:
            while time.monotonic() < end:
                if select.select([terminal], [], [], 0.2)[0]:
                    said += os.read(terminal, 4096)
                elif b"Enter ends" in said:
                    # Again if nothing comes of it: bash forgets a Ctrl-C just before it begins to read.
                    os.write(terminal, key)
            os.killpg(pid, signal.SIGKILL)
        except OSError:
            pass  # its end
        os.close(terminal)
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), said.decode()

    def test_every_key_that_ends_the_server_is_a_success(self):
        for key in (b"\n", b"\x04", b"\x03"):  # Enter, Ctrl-D, Ctrl-C
            code, said = self.on_terminal(key)
            self.assertEqual(code, 0, said)
            self.assertNotIn("failed", said)
            shutil.rmtree(self.at("out"))

    def test_it_names_the_page_if_the_server_has_one(self):
        # npm may be there and its registry not: the server is then built without the page.
        for page, times in (("index.html", 2), ("no_page.html", 0)):
            self.serve_page(page)
            code, said = self.on_terminal(b"\n")
            self.assertEqual(code, 0, said)
            self.assertEqual(said.count("in a browser"), times, said)
            shutil.rmtree(self.at("out"))

    def test_settings_of_another_server_do_not_matter(self):
        self.environment |= {"LITAGS_STORE": "postgresql://db/litags", "LITAGS_SERVER_WORKERS": "0",
                             "LITAGS_TOKEN": "secret"}
        code, said = self.on_terminal(b"\n")
        self.assertEqual(code, 0, said)

    def test_folders_where_cd_looks_do_not_matter(self):
        self.environment["CDPATH"] = f".:{self.folder}"
        code, said = self.on_terminal(b"\n")
        self.assertEqual(code, 0, said)


class FolderOfTheScript(ScriptTest):

    def test_folders_where_cd_looks_do_not_matter(self):
        for name in (".ci", "tests/attack", "tests/cluster", "tests/crash", "tests/fuzz", "tests/load"):
            script = self.write(self.at("root", name, "run"), "")
            shutil.copy(os.path.join(os.path.dirname(DEPLOY), name, "run"), script)
            os.makedirs(self.at("elsewhere", name))
        for name in ("attack/mixed", "cluster/long_run", "crash/long_run", "load/load"):
            self.write(self.at("root", "tests", name + ".py"), "print('it runs')")
        for name in ("deploy/test", "build/fuzz/bin/fuzz_x"):
            self.write(self.at("root", name), "#!/bin/sh\necho it runs\n")
        os.makedirs(self.at("root", "build", "release"))
        self.environment["CDPATH"] = self.at("elsewhere")
        for command in (".ci/run", "tests/attack/run", "tests/cluster/run", "tests/crash/run",
                        "tests/fuzz/run 1 x", "tests/load/run"):
            code, out = self.run_script("bash", "-c", f"cd '{self.at('root')}' && exec bash {command}")
            self.assertEqual(code, 0, f"{command}: {out}")
            self.assertNotIn("elsewhere", out)


class TestOfManyCases(ScriptTest):

    def test_a_case_that_is_skipped_shows_unless_another_failed(self):
        program = self.write(self.at("cases.py"), """import unittest
import skipping
class Case(unittest.TestCase):
    def passed(self): pass
    def skipped(self): self.skipTest("not here")
    def failed(self): self.fail()
skipping.run_tests()
""")
        self.environment["PYTHONPATH"] = os.path.join(os.path.dirname(DEPLOY), "tests", "support")
        for cases, wanted in (("passed", 0), ("passed skipped", 77), ("skipped failed", 1)):
            names = [f"Case.{case}" for case in cases.split()]
            code, out = self.run_script(sys.executable, "-B", program, *names)
            self.assertEqual(code, wanted, out)


if __name__ == "__main__":
    unittest.main(verbosity=2)
