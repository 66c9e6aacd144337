"""Formats the project's C++ files, or with --check lists those that are not formatted.

Exit status 77, which CTest shows as skipped: no clang-format of the version that the style is for.
"""

import argparse
import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import sys

from cpp_files import cpp_files

# Debian 12's. Other versions break lines elsewhere, so that two people would format in turns.
VERSION = 14
UNUSABLE = 77
FILES_PER_CALL = 40


def find_program():
    """(path, None), or (None, what to do)."""
    for name in (f"clang-format-{VERSION}", "clang-format"):
        path = shutil.which(name)
        if path is None:
            continue
        told = subprocess.run([path, "--version"], capture_output=True, text=True, check=True).stdout
        found = re.search(r"version (\d+)", told)
        if found and int(found[1]) == VERSION:
            return path, None
        return None, f"{path} has version {found[1] if found else '?'}, the style is for {VERSION}"
    return None, f"clang-format {VERSION} is not installed; deploy/bootstrap installs it"


def unformatted(program, source, files):
    """Those of `files` that clang-format would change, with the first line that it would."""
    parts = [files[i:i + FILES_PER_CALL] for i in range(0, len(files), FILES_PER_CALL)]

    def check(part):
        done = subprocess.run([program, "--dry-run", *part], cwd=source, capture_output=True,
                              text=True, check=False)
        places = re.findall(r"^([^\s:]+:\d+):\d+: \w+: code should be clang-formatted",
                            done.stderr, re.MULTILINE)
        if done.returncode != 0:
            places.append(done.stderr.strip())
        return places

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        places = [place for part in pool.map(check, parts) for place in part]
    first = {}
    for place in places:
        first.setdefault(place.split(":")[0], place)
    return sorted(first.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing")
    parser.add_argument("source", type=pathlib.Path, help="the project's folder")
    args = parser.parse_args()
    program, problem = find_program()
    if problem:
        print(f"format: skipped: {problem}")
        return UNUSABLE
    files = cpp_files(args.source)
    if not files:
        print(f"format: {args.source} has no C++ files", file=sys.stderr)
        return 1
    places = unformatted(program, args.source, files)
    if not args.check:
        names = [place.split(":")[0] for place in places]
        if names:
            subprocess.run([program, "-i", *names], cwd=args.source, check=True)
        print(f"format: {len(names)} of {len(files)} files changed")
        return 0
    for place in places:
        print(f"{place}: not formatted")
    if places:
        print("format: run `cmake --build --preset release --target format`")
        return 1
    print(f"format: {len(files)} files are formatted")
    return 0


if __name__ == "__main__":
    sys.exit(main())
