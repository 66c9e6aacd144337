"""The format check finds what is not formatted; lint checks the sources that a change concerns."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import format as formatter
import lint

sys.path.insert(0, os.path.join(os.environ["LITAGS_SOURCE"], "tests/support"))
import skipping  # noqa: E402

SCRIPT = pathlib.Path(__file__).with_name("format.py")
STYLE = pathlib.Path(os.environ["LITAGS_SOURCE"], ".clang-format")


class FormatTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.source = pathlib.Path(self.folder.name)
        self.source.joinpath(".clang-format").write_bytes(STYLE.read_bytes())
        self.file = self.source / "engine/core/a.cc"
        self.file.parent.mkdir(parents=True)

    def run_format(self, *args, **environment):
        return subprocess.run([sys.executable, "-B", SCRIPT, *args, self.source],
                              capture_output=True, text=True, env={**os.environ, **environment},
                              check=False)

    def test_without_clang_format_it_skips_and_says_so(self):
        done = self.run_format("--check", PATH="/nonexistent")
        self.assertEqual(done.returncode, formatter.UNUSABLE)
        self.assertIn("clang-format 14 is not installed", done.stdout)

    def test_it_names_the_line_and_repairs_it(self):
        if formatter.find_program()[0] is None:
            self.skipTest(formatter.find_program()[1])
        self.file.write_text("int a;\nint  b;\n")
        done = self.run_format("--check")
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("engine/core/a.cc:2: not formatted", done.stdout)
        self.assertIn("1 of 1 files changed", self.run_format().stdout)
        self.assertEqual(self.file.read_text(), "int a;\nint b;\n")
        self.assertEqual(self.run_format("--check").returncode, 0)


class LintTest(unittest.TestCase):
    def test_changed_headers_are_checked_through_a_source(self):
        text = {"engine/a/a.cc": "", "engine/a/b.cc": '#include "engine/a/only.h"\n',
                "engine/a/c.cc": '#include "engine/a/only.h"\n', "engine/a/d.cc": ""}
        changed = ["docs/a.md", "engine/a/a.h", "engine/a/only.h", "engine/a/d.cc", "engine/a/x.cc"]
        self.assertEqual(lint.sources_of(changed, text, text.get),
                         ["engine/a/a.cc", "engine/a/b.cc", "engine/a/d.cc"])

    def test_an_unknown_base_is_an_error(self):
        os.environ["LITAGS_LINT_BASE"] = "no-such-commit"
        self.addCleanup(os.environ.pop, "LITAGS_LINT_BASE")
        changed, problem = lint.changed_files(STYLE.parent)
        self.assertIsNone(changed)
        self.assertIn("no-such-commit", problem)


if __name__ == "__main__":
    skipping.run_tests()
