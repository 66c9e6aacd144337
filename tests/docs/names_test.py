"""Every test and every file of the project that a page names between backticks is there."""

import ast
import fnmatch
import os
import pathlib
import re
import subprocess
import unittest

from links_test import FOLDERS, SOURCE, pages, without_code

BUILD = pathlib.Path(os.environ["LITAGS_BIN"]).parent
# A case: `module/Suite.Case`, `Suite.Begins...`, `Suite.*`, `module/Suite*`, and of Python
# `Class.test_begins_...`; a call of the API is none.
CASE = re.compile(r"(?!\w+Service\.)([a-z_]+/)*[A-Z]\w*[a-z]\w*(/\w+)?\.([A-Z*][\w*]*|test_\w+)(\.\.\.)?"
                  r"|([a-z_]+/)+[A-Z]\w*\*")
# A test of CTest, or all of a module: `crash/kill`, `sfm/colmap`. Folders look the same.
NAME = re.compile(r"[a-z][a-z0-9_]*(/[a-z0-9_]+)+")
SOURCES = re.compile(r"\w+_test\.(cc|py)")  # of tests, wherever they are
FILE = re.compile(rf"({'|'.join(FOLDERS)})/[\w./-]+\.\w+")
# What is a test by its place: the last column of a table, and classes of Python.
COLUMN = re.compile(r"^\|.*\| (?:Tried by|Test) \|\n\|[-:|]+\n((?:\|.*\n)+)", re.MULTILINE)
CLASSES = re.compile(r"\bclass(?:es)?\s((?:`\w+`(?:,|\sand)?\s?)+)")
# Of commands: which tests show what a page says.
FILTER = re.compile(r"(?:\bctest\s[^`]{0,40}?|`)-([RL])\s(?:'([^']+)'|([\w/.|-]+))")
PLACEHOLDER = "NAME"


def ctest(*options):
    run = subprocess.run(["ctest", *options], cwd=BUILD, check=True, capture_output=True, text=True)
    return run.stdout


def words(text):
    return re.findall(r"`([^`\s]+)`", text)


class Tests:
    """All that there are."""

    def __init__(self):
        self.names = re.findall(r"^ +Test +#\d+: (\S+)", ctest("-N"), re.MULTILINE)
        self.labels = re.findall(r"^  (\w+)$", ctest("--print-labels"), re.MULTILINE)
        self.folders = {name.split("/")[0] for name in self.names}
        self.sources = {path.name for folder in FOLDERS
                        for path in SOURCE.joinpath(folder).rglob("*_test.*")}
        self.classes = {}  # of Python, with their cases and what they inherit
        for path in SOURCE.joinpath("tests").rglob("*_test.py"):
            for part in ast.parse(path.read_text()).body:
                if isinstance(part, ast.ClassDef):
                    cases = self.classes.setdefault(part.name, [])
                    cases += [case.name for case in part.body if isinstance(case, ast.FunctionDef)]
                    for base in part.bases:
                        cases += self.classes.get(ast.unparse(base), ())

    def has(self, word):
        if SOURCES.fullmatch(word):
            return word in self.sources
        pattern = word.replace("...", "*")
        name, _, case = pattern.partition(".")
        return (any(fnmatch.filter(self.names, before + pattern + after)
                    for before in ("", "*/") for after in ("", "/*", ".*"))
                or bool(fnmatch.filter(self.classes.get(name, ()), case or "test_*")))

    def is_there(self, word):
        """None: the word is not the name of a test or a file."""
        if CASE.fullmatch(word) or SOURCES.fullmatch(word):
            return self.has(word)
        if FILE.fullmatch(word):
            return SOURCE.joinpath(word).exists()
        if NAME.fullmatch(word) and word.split("/")[0] in self.folders:
            return self.has(word) or SOURCE.joinpath(word).exists()
        return None

    def named(self, text):
        """{name: whether it is there} of a page without its blocks of code."""
        found = {word: self.is_there(word) for word in words(text)}
        found = {word: there for word, there in found.items() if there is not None}
        for rows in COLUMN.findall(text):
            for row in rows.splitlines():
                found.update((word, self.has(word)) for word in words(row.split(" | ")[-1]))
        for classes in CLASSES.findall(text):
            found.update((word, self.has(word)) for word in words(classes))
        return found

    def filters(self, text):
        """{filter: whether it finds a test} of the commands of a page."""
        found = {}
        for option, quoted, plain in FILTER.findall(text):
            known = self.names if option == "R" else self.labels
            for part in (quoted or plain).split("|"):
                if part != PLACEHOLDER:
                    found[f"-{option} {part}"] = any(re.search(part, name) for name in known)
        return found


class NamesTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.tests = Tests()

    def assert_all_there(self, found, at_least):
        """`found`: (page, {name: whether it is there}) each."""
        seen = sum(len(names) for _, names in found)
        self.assertGreater(seen, at_least)
        self.assertEqual([], [f"{page.relative_to(SOURCE)}: {name}" for page, names in found
                              for name, there in names.items() if not there])

    def test_what_pages_name_is_there(self):
        self.assert_all_there([(page, self.tests.named(without_code(page))) for page in pages()], 150)

    def test_what_pages_filter_by_finds_tests(self):
        self.assert_all_there([(page, self.tests.filters(page.read_text())) for page in pages()], 15)

    def test_what_is_gone_is_found(self):
        found = self.tests.named("""
`crash/gone`, `server/gone`, `Store.test_gone_...`, `JobsApi.Gone...`, `tests/gone.py`, `gone_test.cc` and
the classes `Gone`, `Store`
and `Lost`, but `crash/kill`, `sfm/colmap`, `Store.test_second_server...`, `JobsApi.Create...`,
`names_test.py`, `tests/docs/names_test.py`; `image/png`, `jobs/ID` and `JobsService.Gone` are no tests.

| `Fault` | Tried by |
|---|---|
| `Outcome` | `Vanished`, `service/jobs` |
| `Outcome` | `Checkpoints` |
""")
        self.assertEqual([name for name, there in found.items() if not there],
                         ["crash/gone", "server/gone", "Store.test_gone_...", "JobsApi.Gone...",
                          "tests/gone.py", "gone_test.cc", "Vanished", "Gone", "Lost"])
        self.assertEqual(len(found), 18)
        found = self.tests.filters("""
Run `ctest --preset release
-R gone/` or `-L gone`, or `ctest -L crash`; `-R 'crash/kill|gone/b'` and `ctest -R NAME`.
""")
        self.assertEqual(found, {"-R gone/": False, "-L gone": False, "-L crash": True,
                                 "-R crash/kill": True, "-R gone/b": False})


if __name__ == "__main__":
    unittest.main()
