"""docs/api.md lists every reason that the code gives, and no other."""

import os
import pathlib
import re
import unittest

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])
# Upper-case words of the code that are no reasons.
OTHERS = re.compile(r"(LITAGS|AWS|SIMPLE)_")
NOT_SHIPPED = re.compile(r"_test|conformance|/testing/|engine/(tools|sample)/")


def reasons_of_code():
    reasons = set()
    for folder in ("server", "engine"):
        for path in SOURCE.joinpath(folder).rglob("*.*"):
            if path.suffix in (".cc", ".h") and not NOT_SHIPPED.search(str(path.relative_to(SOURCE))):
                reasons.update(re.findall(r'"([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)+)"', path.read_text()))
    return {r for r in reasons if not OTHERS.match(r)}


class ReasonsTest(unittest.TestCase):
    def test_the_page_has_the_reasons_of_the_code(self):
        page = SOURCE.joinpath("docs/api.md").read_text()
        listed = re.findall(r"`([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)+)`", page)
        self.assertEqual(len(listed), len(set(listed)), "a reason is listed twice")
        self.assertEqual(set(listed), reasons_of_code())


if __name__ == "__main__":
    unittest.main()
