"""docs/settings.md lists every setting of litags-server with its default, and no other."""

import json
import os
import pathlib
import re
import subprocess
import unittest

SOURCE = pathlib.Path(os.environ["LITAGS_SOURCE"])
SERVER = pathlib.Path(os.environ["LITAGS_BIN"]) / "litags-server"
UNITS = {"MiB": 1 << 20, "GiB": 1 << 30}


def settings_of_page():
    """(name, default) of each row: "512 MiB" as a number, "16 (4 MiB)" as 16."""
    page = SOURCE.joinpath("docs/settings.md").read_text()
    for name, default in re.findall(r"^\| `([a-z0-9-]+)`[ †]*\| ([^|]*)\|", page, re.MULTILINE):
        default = re.sub(r" \(.*\)", "", default).strip()
        size = re.fullmatch(r"(\d+) ([MG]iB)", default)
        yield name, str(int(size[1]) * UNITS[size[2]]) if size else default


def settings_of_program():
    told = subprocess.run([SERVER, "--print-config"], env={"HOME": "/~"}, capture_output=True,
                          text=True, check=True).stdout.replace("/~", "~")
    for line in told.splitlines():
        name, value = re.fullmatch(r"(?:# )?([a-z0-9-]+) = (.*)  # default", line).groups()
        if value == "[]" or value.startswith("(0 values"):
            value = '""'
        yield name, str(json.loads(value)) if value.startswith('"') else value


class SettingsTest(unittest.TestCase):
    def test_the_page_has_the_settings_of_the_program(self):
        listed = list(settings_of_page())
        self.assertEqual(len(listed), len(dict(listed)), "a setting is listed twice")
        self.assertEqual(dict(listed), dict(settings_of_program()))


if __name__ == "__main__":
    unittest.main()
