"""The Debian package that `cpack` makes: what is in it, what it depends on, and that it runs.

Run by CTest with LITAGS_BUILD and LITAGS_CPACK in the environment.
"""

import glob
import gzip
import os
import re
import subprocess
import tempfile
import unittest

BUILD = os.environ["LITAGS_BUILD"]
PROGRAMS = """litags litags-bench litags-film litags-inspect litags-sample litags-server litags-sheet litags-train
    litags-worker""".split()


def run(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise AssertionError(f"{command} ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


class Package(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        run(os.environ["LITAGS_CPACK"], "-G", "DEB", "--config",
            os.path.join(BUILD, "CPackConfig.cmake"), "-B", folder.name)
        cls.package, = glob.glob(os.path.join(folder.name, "*.deb"))
        cls.root = os.path.join(folder.name, "root")
        run("dpkg-deb", "-x", cls.package, cls.root)

    def path(self, name):
        return os.path.join(self.root, name)

    def test_it_has_programs_pages_and_the_service_and_no_more(self):
        files = [line.split()[5][2:] for line in run("dpkg-deb", "-c", self.package).splitlines()
                 if not line.startswith("d")]
        wanted = ["etc/litags/server.toml", "usr/lib/systemd/system/litags-server.service",
                  "usr/share/doc/litags/copyright"]
        for name in PROGRAMS:
            wanted += [f"usr/bin/{name}", f"usr/share/man/man1/{name}.1.gz"]
        self.assertEqual(sorted(files), sorted(wanted))

    def test_it_depends_on_what_its_programs_link_and_start(self):
        about = run("dpkg-deb", "-I", self.package)
        self.assertIn(" Package: litags\n", about)
        depends, = [line for line in about.splitlines() if line.startswith(" Depends: ")]
        for package in ("colmap", "adduser", "libgrpc++1.51", "libopencv-core406", "libsqlite3-0"):
            self.assertIn(package, depends)
        self.assertIn("/etc/litags/server.toml", run("dpkg-deb", "-I", self.package, "conffiles"))

    def test_unpacked_programs_run(self):
        self.assertRegex(run(self.path("usr/bin/litags"), "--version"), r"^\d+\.\d+\.\d+")
        for name in PROGRAMS:
            self.assertIn("Usage: ", run(self.path("usr/bin/" + name), "--help"))

    def test_the_unit_starts_the_packages_server_with_the_packages_settings(self):
        with open(self.path("usr/lib/systemd/system/litags-server.service")) as file:
            unit = file.read()
        self.assertIn("ExecStart=/usr/bin/litags-server --config /etc/litags/server.toml\n", unit)
        self.assertNotIn("/usr/local", unit)
        settings = run(self.path("usr/bin/litags-server"), "--config",
                       self.path("etc/litags/server.toml"), "--print-config")
        self.assertIn("127.0.0.1:50051", settings)

    def test_man_pages_name_every_command_and_no_folder_of_the_build(self):
        for name in PROGRAMS:
            with gzip.open(self.path(f"usr/share/man/man1/{name}.1.gz"), "rt") as file:
                page = file.read()
            self.assertIn("\n.SH NAME\n" + name.replace("-", "\\-") + " \\- ", page)
            for folder in (BUILD, os.path.expanduser("~/")):
                self.assertNotIn(folder, page)
            if name == "litags":
                said = run(self.path("usr/bin/litags"), "--help")
                listed = said.split("\nSubcommands:\n")[1].split("\n\n")[0]
                commands = re.findall(r"(?m)^  (\w+)", listed)
                self.assertLessEqual({"submit", "inspect"}, set(commands))
                for command in commands:
                    self.assertIn(f".SH COMMAND {command.upper()}\n", page)


if __name__ == "__main__":
    unittest.main(verbosity=2)
