"""litags::engine and litags::client from an installed tree, and `cmake --install`.

Run by CTest with LITAGS_BIN (folder of the programs), LITAGS_BUILD, LITAGS_SOURCE and LITAGS_CMAKE
in the environment.
"""

import glob
import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest

BIN = os.environ["LITAGS_BIN"]
CMAKE = os.environ["LITAGS_CMAKE"]
SOURCE = os.environ["LITAGS_SOURCE"]
HERE = os.path.join(SOURCE, "tests", "library")
ENGINE_HEADERS = """camera cancel depth_network engine error export_request fields frame_process image options pdm_options
    pick_frames picture_io recipe report scene tone_options""".split()
CLIENT_HEADERS = "capture client connection interrupt picture_file status upload".split()


def run(*command, fails=False):
    """What a program says; an end that was not expected is the test's failure."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if (done.returncode != 0) != fails:
        raise AssertionError(f"{command} ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


def bytes_of(path):
    with open(path, "rb") as file:
        return file.read()


class Library(unittest.TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def install(self, component):
        run(CMAKE, "--install", os.environ["LITAGS_BUILD"], "--component", component, "--prefix",
            self.path("local"))

    def headers(self, folder):
        found = glob.glob(self.path(f"local/include/litags/{folder}*.h"))
        return sorted(os.path.basename(path)[:-2] for path in found)

    def configure(self, program, *settings):
        """In a fresh folder, as a project of its own would be."""
        project = self.path("project")
        shutil.copytree(os.path.join(HERE, program), project)
        run(CMAKE, "-S", project, "-B", self.path("build"), "-G", "Ninja",
            "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", *settings)

    def build(self, *target):
        run(CMAKE, "--build", self.path("build"), *target)

    def assert_own_flags_only(self, file):
        """Nothing of this project's compile line has reached the program's."""
        with open(self.path("build/compile_commands.json")) as commands:
            command, = [c["command"] for c in json.load(commands) if c["file"].endswith(file)]
        self.assertEqual(re.findall(r" -(?:m|W|D(?:HWY|LITAGS))\S*", command), [])

    def test_a_program_finds_the_engine_and_turns_night_into_day(self):
        self.install("engine")
        self.assertEqual(self.headers(""), ENGINE_HEADERS)
        self.assertEqual(os.listdir(self.path("local/include")), ["litags"])
        # The engine needs nothing of the service.
        self.configure("engine_program", "-DCMAKE_PREFIX_PATH=" + self.path("local"),
                       "-DCMAKE_DISABLE_FIND_PACKAGE_gRPC=ON",
                       "-DCMAKE_DISABLE_FIND_PACKAGE_Protobuf=ON")
        self.assert_own_flags_only("night_to_day.cc")
        self.build()

        run(os.path.join(BIN, "litags-sample"), self.path("room"), "--views", "12", "--size", "120x90")
        photos, cameras = self.path("room/low"), self.path("room/transforms_train.json")
        run(self.path("build/night_to_day"), photos, self.path("work"), self.path("view.png"), "20",
            cameras)
        run(os.path.join(BIN, "litags-train"), photos, "--cameras", cameras, "-o",
            self.path("out"), "--iterations", "20")
        first = min(glob.glob(self.path("out/views/*.png")))
        self.assertEqual(bytes_of(self.path("view.png")), bytes_of(first))

    def test_the_page_shows_the_program_that_is_tested(self):
        page = bytes_of(os.path.join(SOURCE, "docs", "library.md"))
        self.assertIn(bytes_of(os.path.join(HERE, "engine_program", "night_to_day.cc")), page)

    def test_a_program_finds_the_client_and_asks_a_server(self):
        self.install("client")
        self.assertEqual(self.headers("client/"), CLIENT_HEADERS)
        self.assertEqual(self.headers(""), [])
        self.configure("client_program", "-DCMAKE_PREFIX_PATH=" + self.path("local"),
                       "-DCMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON")
        self.assert_own_flags_only("list_jobs.cc")
        self.build()
        # No server listens there.
        self.assertIn("UNAVAILABLE", run(self.path("build/list_jobs"), "127.0.0.1:9", fails=True))

    def test_what_is_not_installed_is_not_found(self):
        self.install("client")
        project = os.path.join(HERE, "engine_program")
        said = run(CMAKE, "-S", project, "-B", self.path("build"), "-G", "Ninja",
                   "-DCMAKE_PREFIX_PATH=" + self.path("local"), fails=True)
        self.assertIn("litags has no component engine here", said)

    def test_a_project_that_contains_the_source_needs_no_grpc_and_keeps_its_flags(self):
        self.configure("engine_program", "-DLITAGS_SOURCE=" + SOURCE,
                       *("-DCMAKE_DISABLE_FIND_PACKAGE_%s=ON" % name
                         for name in ("gRPC", "Protobuf", "CURL", "spdlog", "GTest")))
        self.build("--target", "CMakeFiles/night_to_day.dir/night_to_day.cc.o")
        self.assert_own_flags_only("night_to_day.cc")

    def test_installed_programs_and_the_unit_fit_together(self):
        built = [name for name in ("litags", "litags-server", "litags-worker", "litags-train")
                 if os.path.exists(os.path.join(BIN, name))]
        self.assertTrue(built)
        self.install("programs")
        for name in built:
            run(self.path(os.path.join("local/bin", name)), "--version")
        self.assertEqual([name for name in os.listdir(self.path("local/bin")) if "fake" in name], [])
        unit = bytes_of(self.path("local/lib/systemd/system/litags-server.service")).decode()
        programs = set(re.findall(r"^Exec\w+=(\S+)", unit, re.MULTILINE))
        self.assertEqual(programs, {self.path("local/bin/litags-server")})


if __name__ == "__main__":
    unittest.main(verbosity=2)
