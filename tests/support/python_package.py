"""The package of client/python, installed for a test as its user would install it on Debian."""

import importlib.util
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

INSTALLED = "LITAGS_PYTHON_PACKAGE"
SKIPPED = 77  # what CTest takes for "skipped": SKIP_RETURN_CODE
SOURCE = pathlib.Path(__file__).resolve().parents[2]


def missing():
    """Why the package cannot be built here, or None."""
    for module in ("pip", "setuptools", "wheel"):
        if importlib.util.find_spec(module) is None:
            return f"python3-{module} is not installed"
    return None


def install(work):
    """Builds the package from a copy of the source and installs it, without network, into a virtual
    environment in the folder `work` that sees Debian's packages. Returns its Python."""
    for folder in ("client/python", "proto"):
        shutil.copytree(SOURCE / folder, pathlib.Path(work, "source", folder))
    python = os.path.join(work, "venv/bin/python")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", "--system-site-packages",
                    os.path.dirname(os.path.dirname(python))], check=True)
    subprocess.run([sys.executable, "-m", "pip", "--python", python, "install", "--quiet",
                    "--no-index", "--no-build-isolation", "--disable-pip-version-check",
                    os.path.join(work, "source/client/python")], check=True)
    return python


def run_installed():
    """Runs this test again with a Python that has the package, and exits; returns where that is this
    one."""
    if INSTALLED in os.environ:
        return
    if why := missing():
        print("skipped:", why)
        sys.exit(SKIPPED)
    with tempfile.TemporaryDirectory(prefix="litags-python-") as work:
        python = install(work)
        # The stubs of other tests would stand before those of the package.
        environment = dict(os.environ, LITAGS_STUBS=work)
        environment[INSTALLED] = "1"
        sys.exit(subprocess.run([python, "-B", *sys.argv], env=environment).returncode)
