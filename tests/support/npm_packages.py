"""Programs of others from npm, as a lock file names them, for tests that are skipped without."""

import fcntl
import pathlib
import re
import shutil
import subprocess
import sys

import skipping

# npm's codes of a registry that is not there, and of a network that is not.
UNREACHABLE = re.compile(r"(ENOTFOUND|EAI_AGAIN|ECONNREFUSED|ECONNRESET|ENETUNREACH|EHOSTUNREACH|"
                         r"E\w*TIMEDOUT|ERR_SOCKET_TIMEOUT|E50[234])")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def install(source, work, extra=()):
    """Puts package.json, its lock file and the files `extra` of the folder `source` into `work` and
    installs what they name, one caller at a time. Returns None, or why that cannot be done here: npm is
    not there, or its registry cannot be reached. RuntimeError if npm fails at anything else."""
    if not shutil.which("npm") or not shutil.which("node"):
        return "node and npm are not installed"
    work.mkdir(parents=True, exist_ok=True)
    with open(work / ".lock", "w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        return _install(source, work, extra)


def _install(source, work, extra):
    for name in ("package.json", "package-lock.json", *extra):
        shutil.copy(pathlib.Path(source, name), work)
    done = work / "node_modules/.litags-lock"
    lock = pathlib.Path(source, "package-lock.json").read_text()
    if done.exists() and done.read_text() == lock:
        return None
    try:
        run = subprocess.run(
            ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline",
             "--fetch-retries=0"],
            cwd=work, capture_output=True, text=True, timeout=240)
    except subprocess.TimeoutExpired:
        return "the registry of npm does not answer"
    if run.returncode != 0:
        if code := UNREACHABLE.search(run.stderr):
            return f"the registry of npm cannot be reached: {code[0]}"
        raise RuntimeError("npm ci cannot install: " + run.stderr.strip()[-1000:])
    done.write_text(lock)
    return None


def skip(why):
    print("skipped:", why)
    sys.exit(skipping.SKIPPED)


def install_or_skip(source, work, extra=()):
    """As install(); ends the program, as skipped, if that cannot be done."""
    if why := install(source, work, extra):
        skip(why)


def run_browser_tests(source, work, *steps):
    """Runs the tests of the calling program, which take the files `steps` of `source` to Chromium,
    and ends the program."""
    if not CHROMIUM:
        skip("chromium is not installed")
    install_or_skip(source, work, steps)
    skipping.run_tests()
