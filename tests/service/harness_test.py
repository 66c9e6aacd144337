"""A test fails whose server ended badly, though all that it asked was answered well."""

import os
import shutil
import tempfile
import unittest

import harness

RACE = "WARNING: ThreadSanitizer: data race (pid=1)"
OVERFLOW = "a.cc:7:3: runtime error: signed integer overflow"


class Harness(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="litags-harness-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def program(self, exit_code, at_end="", at_start=""):
        """A program that starts as a server does, and ends with SIGTERM."""
        path = os.path.join(self.folder, "program")
        with open(path, "w") as file:
            file.write(f"""#!/bin/sh
trap 'echo "{at_end}" >&2; exit {exit_code}' TERM
while [ "$1" != --port-file ]; do shift; done
echo "{at_start}"
echo 1 > "$2.new" && mv "$2.new" "$2"
while :; do sleep 0.02; done
""")
        os.chmod(path, 0o755)
        return path

    def server(self, *args, **more):
        return harness.Server(self.folder, program=self.program(*args, **more))

    def result_of_test(self, *args):
        """The result of a test that passes on such a server."""
        program = self.program(*args)

        class Passes(harness.ServiceTest):

            @classmethod
            def make_server(cls):
                return harness.Server(cls.class_folder, program=program)

            def test(self):
                pass

        result = unittest.TestResult()
        unittest.defaultTestLoader.loadTestsFromTestCase(Passes).run(result)
        self.assertEqual(result.testsRun, 1)
        return result

    def test_a_server_that_ends_well_fails_no_test(self):
        self.assertTrue(self.result_of_test(0).wasSuccessful())

    def test_a_server_that_ends_with_a_report_fails_its_test(self):
        [(_, said)] = self.result_of_test(66, RACE).errors
        self.assertIn(RACE, said)

    def test_any_exit_code_but_the_expected_one_fails(self):
        with self.assertRaisesRegex(AssertionError, "ended with 3, not 0"):
            self.server(3).stop()
        self.server(3).stop(exit_code=3)

    def test_a_report_fails_whatever_the_exit_code(self):
        with self.assertRaisesRegex(AssertionError, OVERFLOW):
            self.server(0, OVERFLOW).stop()

    def test_a_server_that_ended_by_itself_fails_even_where_it_is_killed(self):
        for end in ("stop", "kill"):
            server = self.server(1)
            server.process.terminate()
            server.process.wait(harness.PATIENCE_S)
            with self.assertRaisesRegex(AssertionError, "ended with 1"):
                getattr(server, end)()

    def test_a_server_that_is_killed_fails_for_a_report_alone(self):
        server = self.server(0)
        server.kill()
        server.stop()  # as cleanups do
        with self.assertRaisesRegex(AssertionError, OVERFLOW):
            self.server(0, at_start=OVERFLOW).kill()


if __name__ == "__main__":
    unittest.main(verbosity=2)
