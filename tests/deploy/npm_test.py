"""The rules that build the page and the viewer, with stubs of npm and node: a build tries again after
npm has failed, and only then."""

import os
import shutil
import subprocess
import tempfile
import unittest

CMAKE = os.environ["LITAGS_CMAKE"]
ROOT = os.path.dirname(os.environ["LITAGS_DEPLOY"])

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


class Rules(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="litags-npm-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def at(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, name, text):
        with open(self.at(name), "w") as file:
            file.write(text)
        os.chmod(self.at(name), 0o755)

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


if __name__ == "__main__":
    unittest.main(verbosity=2)
