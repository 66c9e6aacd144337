"""Every link of a page to a file of the project, or to a heading, leads somewhere."""

import os
import pathlib
import re
import unittest

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"]).resolve()
FOLDERS = ("client", "deploy", "docs", "engine", "proto", "server", "tests")


def pages():
    yield from SOURCE.glob("*.md")
    for folder in FOLDERS:
        yield from SOURCE.joinpath(folder).rglob("*.md")


def without_code(page):
    return re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def anchors(page):
    """As GitHub makes them from headings."""
    for heading in re.findall(r"^#+ (.*)", without_code(page), re.MULTILINE):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        yield re.sub(r"[^\w\- ]", "", text).strip().replace(" ", "-")


def broken(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", without_code(page)):
        path, _, anchor = link.partition("#")
        if re.match(r"[a-z]+:", link):
            continue
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            yield f"{page.relative_to(SOURCE)}: {link}"


class LinksTest(unittest.TestCase):
    def test_links_lead_somewhere(self):
        found = list(pages())
        self.assertGreater(len(found), 20)
        self.assertEqual([link for page in found for link in broken(page)], [])


if __name__ == "__main__":
    unittest.main()
