"""Commands for the paper's tables train as long as the paper does, not as long as is the default."""

import os
import pathlib
import re
import unittest

DOCS = pathlib.Path(os.environ["LITAGS_SOURCE"]) / "docs"


class PaperTest(unittest.TestCase):
    def test_tables_of_lom_have_15000_iterations(self):
        commands = [command for page in ("paper.md", "evaluation.md")
                    for command in re.findall(r"`(litags-bench table LOM[^`]*)`",
                                              DOCS.joinpath(page).read_text())]
        self.assertGreaterEqual(len(commands), 4)
        self.assertEqual([c for c in commands if "--iterations 15000" not in c], [])


if __name__ == "__main__":
    unittest.main()
