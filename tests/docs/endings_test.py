"""docs/inputs.md and docs/video.md name the endings of photos and videos that client, server and engine take,
and no other. The page in the browser takes the same, and titles as long."""

import os
import pathlib
import re
import unittest

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])


def endings(text):
    return re.findall(r"[\"`](\.[a-z0-9]+)[\"`]", text)


def list_of(path, name):
    """Endings of the one list called `name` in a file."""
    _, _, after = SOURCE.joinpath(path).read_text().partition(f"{name} = ")
    return endings(re.match(r"[({][^)}]*[)}]", after).group())


class EndingsTest(unittest.TestCase):
    def test_the_page_has_the_endings_of_the_code(self):
        service = list_of("proto/litags/v1/limits.h", "kPhotoEndings")
        python = SOURCE.joinpath("client/python/src/litags/files.py").read_text()
        words = python.partition("PHOTO_ENDINGS")[2].partition(".split")[0]
        self.assertEqual(service, re.findall(r"(?<=[\" ])\.[a-z0-9]+", words))
        self.assertEqual(service, list_of("engine/io/photo_format.cc", "kEndings[]"))
        rows = re.findall(r"^\|[^|]*\|([^|]*)\|", SOURCE.joinpath("docs/inputs.md").read_text(),
                          re.MULTILINE)
        listed = [ending for row in rows for ending in endings(row)]
        self.assertEqual(sorted(listed), sorted(service))

    def test_the_page_of_videos_has_the_endings_of_the_code(self):
        service = list_of("proto/litags/v1/limits.h", "kVideoEndings")
        self.assertEqual(service, list_of("engine/video/video_file.cc", "kEndings[]"))
        page = SOURCE.joinpath("docs/video.md").read_text()
        row = re.search(r"^\| Endings \|([^|]*)\|", page, re.MULTILINE)[1]
        self.assertEqual(sorted(endings(row)), sorted(service))

    def test_the_page_in_the_browser_has_the_limits_of_the_service(self):
        app = SOURCE / "server/web/app/src"
        limits = SOURCE.joinpath("proto/litags/v1/limits.h").read_text()
        upload = app.joinpath("upload.ts").read_text()
        for kind in ("Photo", "Video", "Archive"):
            taken = re.search(rf"k{kind} = /(.*)/i;", upload)[1]
            service = re.findall(r'"(.*?)"', re.search(rf"k{kind}Endings = {{(.*?)}}", limits, re.DOTALL)[1])
            for ending in service:
                self.assertRegex("a" + ending, taken)
            # "jpe?g|tiff?": one for each word, and one more for each letter that may lack.
            self.assertEqual(1 + taken.count("|") + taken.count("?"), len(service), kind)
        title = re.search(r"kTitleBytes = (\d+);", app.joinpath("format.ts").read_text())[1]
        self.assertEqual(re.search(r"kMaxDisplayNameBytes = (\d+);", limits)[1], title)


if __name__ == "__main__":
    unittest.main()
