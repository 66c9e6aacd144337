"""The folders include each other as docs/architecture.md says, and the check of it finds faults."""

import os
import pathlib
import unittest

import arrows
from cpp_files import cpp_files

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])

PAGE = """
| Folder | Owns | May include |
|---|---|---|
| `client` | the program | proto/litags/v1 |
| `server/api` | handlers | jobs, proto/litags/v1, engine/pipeline |
| `server/jobs` | the life of a job | |
| `engine/pipeline` | photos to scene | all of engine |
| `engine/train` | losses | render |
| `engine/render` | tiles | |
| `engine/core` | images | |
| `proto/litags/v1` | the interface | |

| Library | Header | Only in |
|---|---|---|
| gRPC | `grpc*` | server/api, client |
| SQLite | `sqlite3.h` | server/jobs |
"""


class CodeTest(unittest.TestCase):
    def test_every_include_has_an_arrow_on_the_page(self):
        rules = arrows.Arrows(SOURCE.joinpath(arrows.PAGE).read_text())
        files = cpp_files(SOURCE)
        self.assertGreater(len(files), 500)
        problems = [p for f in files for p in rules.problems(f, SOURCE.joinpath(f).read_text())]
        self.assertEqual(problems, [], "\n" + "\n".join(problems))


class CheckTest(unittest.TestCase):
    def problems(self, path, *includes):
        text = "\n".join(f"#include {i}" for i in includes)
        return list(arrows.Arrows(PAGE).problems(path, text))

    def test_arrows_of_the_page_pass(self):
        self.assertEqual(self.problems("engine/train/a.cc", '"engine/train/a.h"', "<vector>",
                                       '"engine/core/image.h"', '"engine/render/tiles.h"'), [])
        self.assertEqual(self.problems("server/api/a.cc", '"litags/v1/job.pb.h"', "<grpcpp/a.h>",
                                       '"engine/pipeline/engine.h"', '"absl/status/status.h"'), [])
        self.assertEqual(self.problems("engine/pipeline/a.cc", '"engine/train/b.h"'), [])

    def test_other_includes_are_refused(self):
        for path, include in (("engine/render/a.cc", '"engine/train/a.h"'),
                              ("engine/core/a.h", '"engine/render/a.h"'),
                              ("engine/train/a.cc", '"server/jobs/a.h"'),
                              ("engine/train/a.cc", '"litags/v1/job.pb.h"'),
                              ("engine/train/a.cc", "<grpcpp/grpcpp.h>"),
                              ("engine/train/a.cc", "<sqlite3.h>"),
                              ("server/api/a.cc", "<sqlite3.h>"),
                              ("server/api/a.cc", '"engine/train/a.h"'),
                              ("client/a.cc", '"engine/core/a.h"'),
                              ("client/a.cc", '"server/api/a.h"'),
                              ("client/a_test.cc", '"server/api/a.h"'),
                              ("engine/train/a_test.cc", '"server/jobs/a.h"'),
                              ("engine/train/a_test.cc", "<sqlite3.h>"),
                              ("engine/train/a.cc", '"tests/support/a.h"'),
                              ("engine/new/a.cc", "<vector>"),
                              ("engine/train/a.cc", '"engine/new/a.h"')):
            self.assertEqual(len(self.problems(path, include)), 1, (path, include))

    def test_tests_may_include_their_layer_and_what_it_uses(self):
        self.assertEqual(self.problems("engine/core/a_test.cc", '"engine/train/a.h"',
                                       '"tests/support/a.h"'), [])
        self.assertEqual(self.problems("server/jobs/a_test.cc", '"engine/pipeline/a.h"',
                                       '"server/api/a.h"', "<grpcpp/grpcpp.h>"), [])

    def test_a_page_with_a_circle_is_refused(self):
        with self.assertRaisesRegex(arrows.PageError, "render -> engine/train -> engine/render"):
            arrows.Arrows(PAGE.replace("| tiles | |", "| tiles | train |"))

    def test_a_page_without_tables_or_with_an_unknown_folder_is_refused(self):
        with self.assertRaisesRegex(arrows.PageError, "must be a table"):
            arrows.Arrows("# Architecture\n")
        with self.assertRaisesRegex(arrows.PageError, "nothing, which has no row"):
            arrows.Arrows(PAGE.replace("| tiles | |", "| tiles | nothing |"))


if __name__ == "__main__":
    unittest.main()
