"""What needs npm, with stubs of npm and node: the rules that build the page and the viewer try again
after npm has failed, and only then; tests are skipped without its registry, and only then."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

CMAKE = os.environ["LITAGS_CMAKE"]
ROOT = os.path.dirname(os.environ["LITAGS_DEPLOY"])
sys.path.insert(0, os.path.join(ROOT, "tests/support"))
import npm_packages  # noqa: E402

# The rule of a folder, without the library that it is a part of.
PROJECT = """cmake_minimum_required(VERSION 3.25)
project(rule NONE)
set(PROJECT_SOURCE_DIR {root})
function(litags_add_library name)
  cmake_parse_arguments(ARG "RPC" "" "SRCS;DEPS;PRIVATE_DEPS" ${{ARGN}})
  list(GET ARG_SRCS 0 made)
  add_custom_target(${{name}} ALL DEPENDS ${{made}})
endfunction()
add_subdirectory({root}/{rule} rule)
"""
NPM = """#!/bin/sh
echo x >> {folder}/calls
mkdir -p node_modules/playcanvas
touch node_modules/playcanvas/LICENSE
exit $(cat {folder}/exit)
"""
NODE = """#!/bin/sh
for argument; do
  case "$argument" in --outfile=*) echo made > "${argument#*=}" ;; esac
done
"""


class Folder(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="litags-npm-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def at(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, name, text):
        with open(self.at(name), "w") as file:
            file.write(text)
        os.chmod(self.at(name), 0o755)


class Rules(Folder):

    def run_cmake(self, *arguments):
        done = subprocess.run([CMAKE, *arguments], cwd=self.folder, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, done.stdout)

    def calls_of_build(self):
        """How often a build calls npm."""
        self.write("calls", "")
        self.run_cmake("--build", "build")
        with open(self.at("calls")) as file:
            return len(file.readlines())

    def check(self, rule, made):
        self.write("CMakeLists.txt", PROJECT.format(root=ROOT, rule=rule))
        self.write("npm", NPM.format(folder=self.folder))
        self.write("node", NODE)
        self.run_cmake("-G", "Ninja", "-S", ".", "-B", "build",
                       f"-DLITAGS_NPM={self.at('npm')}", f"-DLITAGS_NODE={self.at('node')}")
        made = self.at("build", "rule", made)
        self.write("exit", "1")
        self.assertEqual(self.calls_of_build(), 1)
        first = os.stat(made).st_mtime_ns
        self.assertEqual(self.calls_of_build(), 1)
        self.assertEqual(os.stat(made).st_mtime_ns, first, "nothing is compiled anew")
        self.write("exit", "0")
        self.assertEqual(self.calls_of_build(), 1)
        self.assertGreater(os.stat(made).st_mtime_ns, first)
        self.assertEqual(self.calls_of_build(), 0)

    def test_the_page(self):
        self.check("server/web", "page_assets.cc")

    def test_the_viewer(self):
        self.check("engine/viewer", "viewer.cc")


class Packages(Folder):

    def install(self, npm, path=None):
        """What install() says with this npm."""
        self.write("npm", npm)
        self.write("node", "#!/bin/sh\n")
        for name in ("package.json", "package-lock.json"):
            self.write(name, "{}")
        with mock.patch.dict(os.environ, PATH=path or f"{self.folder}:{os.environ['PATH']}"):
            return npm_packages.install(self.folder, pathlib.Path(self.at("work")))

    def test_without_npm_or_its_registry_tests_are_skipped(self):
        self.assertIn("not installed", self.install("", path="/nonexistent"))
        for code in ("ENOTFOUND", "ECONNREFUSED", "ETIMEDOUT"):
            npm = f"#!/bin/sh\necho npm ERR! code {code} >&2\nexit 1\n"
            self.assertIn(f"cannot be reached: {code}", self.install(npm))

    def test_another_failure_of_npm_is_one_of_the_test(self):
        with self.assertRaisesRegex(RuntimeError, "code EINTEGRITY"):
            self.install("#!/bin/sh\necho npm ERR! code EINTEGRITY >&2\nexit 1\n")

    def test_what_is_installed_is_not_installed_again(self):
        made = "#!/bin/sh\nmkdir node_modules\n"  # a second time it fails
        self.assertEqual([self.install(made), self.install(made)], [None, None])


if __name__ == "__main__":
    unittest.main(verbosity=2)
