"""Which C++ files the project has."""

import pathlib
import subprocess

FOLDERS = ("engine", "server", "client", "proto", "tests")


def cpp_files(source):
    """Paths below `source`: those that git tracks or would add; all of them outside of git."""
    patterns = [f"{folder}/**/*.{ending}" for folder in FOLDERS for ending in ("h", "cc")]
    found = subprocess.run(
        ["git", "-C", source, "ls-files", "--cached", "--others", "--exclude-standard", "--",
         *(f":(glob){p}" for p in patterns)],
        capture_output=True, text=True, check=False)
    if found.returncode == 0:
        names = sorted(set(found.stdout.split()))
        return [name for name in names if pathlib.Path(source, name).is_file()]
    return sorted(str(path.relative_to(source)) for p in patterns
                  for path in pathlib.Path(source).glob(p))
