"""The pages of reasons list every one that the code gives, and no other; the protos name only these."""

import os
import pathlib
import re
import unittest

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])
PAGES = ("errors", "upload-errors", "failed-jobs", "operator-errors", "command-line-errors")
# Upper-case words of the code that are no reasons.
OTHERS = re.compile(r"(LITAGS|AWS|SIMPLE|RADIAL|OPENCV|FULL|COLOR|NVM|GRPC|MODEL_FORMAT_SPZ)_")
NOT_SHIPPED = re.compile(r"_test|conformance|/testing/|engine/sample/")


def reasons_of_code():
    reasons = set()
    for folder in ("server", "engine", "client"):
        for path in SOURCE.joinpath(folder).rglob("*.*"):
            if path.suffix in (".cc", ".h") and not NOT_SHIPPED.search(str(path.relative_to(SOURCE))):
                reasons.update(re.findall(r'"([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)+)"', path.read_text()))
    return {r for r in reasons if not OTHERS.match(r)}


def text_of_pages():
    return "".join(SOURCE.joinpath(f"docs/{page}.md").read_text() for page in PAGES)


class ReasonsTest(unittest.TestCase):
    def test_the_pages_have_the_reasons_of_the_code(self):
        pages = text_of_pages()
        listed = re.findall(r"`([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)+)`", pages)
        self.assertEqual(len(listed), len(set(listed)), "a reason is listed twice")
        self.assertEqual(set(listed), reasons_of_code())

    def test_the_protos_name_reasons_of_the_pages(self):
        text = "".join(p.read_text() for p in SOURCE.joinpath("proto/litags/v1").glob("*.proto"))
        pages = text_of_pages()
        # In comments: after a code, in brackets or in a list.
        comments = " ".join(re.findall(r"//(.*)", text))
        named = set(re.findall(r"\b[A-Z]+(?:_[A-Z]+)+\b", comments))
        values = set(re.findall(r"^\s*([A-Z][A-Z0-9_]+) = \d+;", text, re.MULTILINE))
        codes = {"INVALID_ARGUMENT", "NOT_FOUND", "ALREADY_EXISTS", "FAILED_PRECONDITION",
                 "RESOURCE_EXHAUSTED", "DEADLINE_EXCEEDED", "OUT_OF_RANGE", "DATA_LOSS",
                 "PERMISSION_DENIED", "UPPER_SNAKE_CASE"}
        unknown = {n for n in named - codes
                   if f"`{n}`" not in pages and not any(f"_{v}".endswith(f"_{n}") for v in values)}
        self.assertEqual(unknown, set())


if __name__ == "__main__":
    unittest.main()
