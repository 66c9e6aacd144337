"""No loop over a folder's files throws, and the check of it finds those that would."""

import os
import pathlib
import unittest

import folder_loops
from cpp_files import cpp_files

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])


class CodeTest(unittest.TestCase):
    def test_no_loop_over_a_folder_throws(self):
        found = [p for f in cpp_files(SOURCE)
                 for p in folder_loops.problems(f, SOURCE.joinpath(f).read_text())]
        self.assertEqual(found, [], "\n" + "\n".join(found))


class CheckTest(unittest.TestCase):
    def test_loops_that_throw_are_found(self):
        for loop in ("for (const auto& entry : fs::directory_iterator(dir, ignored)) {",
                     "for (const fs::directory_entry& e :\n   std::filesystem::directory_iterator{d}) {",
                     "for (auto e : fs::recursive_directory_iterator(dir)) {"):
            self.assertEqual(len(list(folder_loops.problems("engine/a/a.cc", "\n" + loop))), 1, loop)
            self.assertIn("a.cc:2:", next(folder_loops.problems("client/a.cc", "\n" + loop)))
            for test in ("engine/a/a_test.cc", "server/testing/a.cc", "tests/a/a.cc"):
                self.assertEqual(list(folder_loops.problems(test, loop)), [])

    def test_loops_with_an_error_code_pass(self):
        loop = ("for (fs::directory_iterator it(d, error), end; !error && it != end;\n"
                "     it.increment(error)) {\n  for (int i : numbers) {}\n}")
        self.assertEqual(list(folder_loops.problems("engine/a/a.cc", loop)), [])


if __name__ == "__main__":
    unittest.main()
