"""Checks the project's C++ files: format, include arrows, loops over folders, and clang-tidy.

clang-tidy takes some 10 s a file, so it checks the sources that changed since $LITAGS_LINT_BASE (a
commit; without it origin/main, else HEAD~1), or with --all every source of the build.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import shutil
import subprocess
import sys

import arrows
import folder_loops
from cpp_files import cpp_files


def git(source, *args):
    done = subprocess.run(["git", "-C", source, *args], capture_output=True, text=True, check=False)
    return done.stdout.split() if done.returncode == 0 else None


def changed_files(source):
    """(files that differ from the base or are new, the base); (None, problem)."""
    asked = os.environ.get("LITAGS_LINT_BASE")
    for base in [asked] if asked else ["origin/main", "HEAD~1"]:
        start = git(source, "merge-base", base, "HEAD")
        if start:
            changed = git(source, "diff", "--name-only", "--diff-filter=d", *start) or []
            new = git(source, "ls-files", "--others", "--exclude-standard") or []
            return sorted({*changed, *new}), base
    return None, f"there is no commit {asked or 'origin/main or HEAD~1'}; set LITAGS_LINT_BASE"


def sources_of(changed, compiled, text_of):
    """Which of `compiled` to check: the changed ones, and for a changed header the source of its
    name, else the first that includes it."""
    chosen = set(changed) & set(compiled)
    for header in (f for f in changed if f.endswith(".h")):
        own = header.removesuffix(".h") + ".cc"
        if own in compiled:
            chosen.add(own)
            continue
        users = (f for f in sorted(compiled) if f'#include "{header}"' in text_of(f))
        chosen.update(user for user in [next(users, None)] if user)
    return sorted(chosen)


def check_arrows(source):
    try:
        rules = arrows.Arrows(source.joinpath(arrows.PAGE).read_text())
    except arrows.PageError as error:
        return [str(error)]
    return [p for f in cpp_files(source) for p in rules.problems(f, source.joinpath(f).read_text())]


def run_clang_tidy(source, build, all_sources):
    """Whether it found nothing."""
    program = shutil.which("clang-tidy-14") or shutil.which("clang-tidy")
    if program is None:
        print("lint: clang-tidy is not installed; on Debian: apt-get install clang-tidy")
        return False
    commands = json.loads(build.joinpath("compile_commands.json").read_text())
    compiled = {os.path.relpath(c["file"], source) for c in commands}
    compiled = {f for f in compiled if f in set(cpp_files(source))}
    if all_sources:
        files, since = sorted(compiled), "all"
    else:
        changed, base = changed_files(source)
        if changed is None:
            print(f"lint: {base}")
            return False
        files = sources_of(changed, compiled, lambda f: source.joinpath(f).read_text())
        since = f"changed since {base}"

    def check(name):
        done = subprocess.run([program, "-p", build, "--quiet", name], cwd=source,
                              capture_output=True, text=True, check=False)
        return name, done.returncode, done.stdout

    failed = 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for name, status, output in pool.map(check, files):
            if status != 0:
                failed += 1
                print(output.strip() or f"{name}: clang-tidy ended with {status}", flush=True)
    print(f"lint: clang-tidy: {failed} of {len(files)} sources ({since}) have findings")
    return failed == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", action="store_true", help="clang-tidy for every source")
    parser.add_argument("source", type=pathlib.Path, help="the project's folder")
    parser.add_argument("build", type=pathlib.Path, help="the build's, configured")
    args = parser.parse_args()
    problems = check_arrows(args.source)
    print("\n".join([*problems, f"lint: includes: {len(problems)} without an arrow"]), flush=True)
    loops = [p for f in cpp_files(args.source)
             for p in folder_loops.problems(f, args.source.joinpath(f).read_text())]
    print("\n".join([*loops, f"lint: loops over folders: {len(loops)} throw"]), flush=True)
    format_script = pathlib.Path(__file__).with_name("format.py")
    formatted = subprocess.run([sys.executable, "-B", format_script, "--check", args.source],
                               check=False).returncode == 0
    tidy = run_clang_tidy(args.source, args.build, args.all)
    return 0 if not problems and not loops and formatted and tidy else 1


if __name__ == "__main__":
    sys.exit(main())
