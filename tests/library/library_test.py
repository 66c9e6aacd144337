"""The engine as a library of another project (consumer/), its example, and `cmake --install`.

Run by CTest with LITAGS_BIN (folder of the programs), LITAGS_BUILD, LITAGS_SOURCE and LITAGS_CMAKE
in the environment.
"""

import os
import subprocess
import tempfile
import unittest

BIN = os.environ["LITAGS_BIN"]
CMAKE = os.environ["LITAGS_CMAKE"]
CONSUMER = os.path.join(os.environ["LITAGS_SOURCE"], "tests", "library", "consumer")


def run(*command):
    """What a program says; its failure is the test's."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise AssertionError(f"{command} ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


class Library(unittest.TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def test_the_example_draws_a_view(self):
        run(os.path.join(BIN, "litags-sample"), self.path("room"), "--views", "12", "--size", "120x90")
        run(os.path.join(BIN, "litags-train"), self.path("room"), "--light", "low", "-o",
            self.path("out"), "--iterations", "20")
        run(os.path.join(BIN, "litags-render-view-example"), self.path("out/scene.litags"),
            self.path("view.png"))
        with open(self.path("view.png"), "rb") as drawn, \
                open(self.path("out/views/0001.png"), "rb") as view:
            self.assertEqual(drawn.read(), view.read())

    def test_a_project_that_adds_the_engine_keeps_its_own_warnings(self):
        # Engine only: configures without gRPC and databases.
        run(CMAKE, "-S", CONSUMER, "-B", self.path("build"), "-G", "Ninja",
            "-DLITAGS=" + os.environ["LITAGS_SOURCE"], "-DLITAGS_ENGINE_ONLY=ON",
            "-DCMAKE_DISABLE_FIND_PACKAGE_gRPC=ON", "-DCMAKE_DISABLE_FIND_PACKAGE_spdlog=ON",
            "-DCMAKE_DISABLE_FIND_PACKAGE_GTest=ON", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON")
        run(CMAKE, "--build", self.path("build"), "--target",
            "CMakeFiles/render_view.dir/render_view.cc.o")
        with open(self.path("build/compile_commands.json")) as file:
            commands = file.read()
        self.assertIn("render_view.cc", commands)
        self.assertNotIn("-Werror", commands)
        self.assertNotIn("-Wall", commands)

    def test_install_puts_what_was_built_where_the_unit_file_expects_it(self):
        built = [name for name in ("litags", "litags-server", "litags-worker", "litags-train")
                 if os.path.exists(os.path.join(BIN, name))]
        self.assertTrue(built)
        run(CMAKE, "--install", os.environ["LITAGS_BUILD"], "--prefix", self.path("local"))
        for name in built:
            run(self.path(os.path.join("local/bin", name)), "--version")
        self.assertEqual([name for name in os.listdir(self.path("local/bin")) if "fake" in name], [])
        unit = os.path.join(os.environ["LITAGS_SOURCE"], "deploy", "litags-server.service")
        with open(unit) as file:
            self.assertIn("ExecStart=/usr/local/bin/litags-server ", file.read())


if __name__ == "__main__":
    unittest.main(verbosity=2)
