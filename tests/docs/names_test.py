"""Every test and every file of the project that a page names between backticks is there."""

import fnmatch
import os
import pathlib
import re
import subprocess
import unittest

from links_test import FOLDERS, SOURCE, pages, without_code

BUILD = pathlib.Path(os.environ["LITAGS_BIN"]).parent
# `module/Suite.Case`, `Suite.Begins...`, `Suite.*`, `module/Suite*`; a call of the API is none.
TEST = re.compile(r"([a-z_]+/)*[A-Z]\w*[a-z]\w*(/\w+)?\.([A-Z*][\w*]*(\.\.\.)?)"
                  r"|([a-z_]+/)+[A-Z]\w*\*")
FILE = re.compile(rf"({'|'.join(FOLDERS)})/[\w./-]+\.\w+")


FILTER = re.compile(r"-R '([^']+)'")  # which tests show what a page says


def tests():
    listed = subprocess.run(["ctest", "-N"], cwd=BUILD, check=True, capture_output=True, text=True)
    return re.findall(r"^ +Test +#\d+: (\S+)", listed.stdout, re.MULTILINE)


def is_test(name, names):
    pattern = name.replace("...", "*")
    return any(fnmatch.filter(names, before + pattern + after)
               for before in ("", "*/") for after in ("", "/*"))


class NamesTest(unittest.TestCase):

    def test_what_pages_name_is_there(self):
        names, seen, missing = tests(), 0, []
        for page in pages():
            for word in re.findall(r"`([^`\s]+)`", without_code(page)):
                if TEST.fullmatch(word) and not re.match(r"\w+Service\.", word):
                    found = is_test(word, names)
                elif FILE.fullmatch(word):
                    found = SOURCE.joinpath(word).exists()
                else:
                    continue
                seen += 1
                if not found:
                    missing.append(f"{page.relative_to(SOURCE)}: {word}")
        self.assertGreater(seen, 150)
        self.assertEqual(missing, [])

    def test_what_pages_filter_by_finds_tests(self):
        names, parts = tests(), set()
        for page in pages():
            for wanted in FILTER.findall(page.read_text()):
                parts.update((page.relative_to(SOURCE), part) for part in wanted.split("|"))
        self.assertGreater(len(parts), 15)
        self.assertEqual([], [f"{page}: {part}" for page, part in sorted(parts)
                              if not any(re.search(part, name) for name in names)])


if __name__ == "__main__":
    unittest.main()
