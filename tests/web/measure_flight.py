"""Frames a second and latency of the page's flight through a made-up scene: no test, a measurement.

measure_flight.py BIN WORK [--gaussians N] [--seconds S] [--threads N]

BIN has the programs, WORK is where npm puts what tests/web needs. The scene is that of `litags-bench
render`, in the place of one that a job has trained for a moment.
"""

import argparse
import json
import os
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import npm_packages  # noqa: E402
from program_end import check_end  # noqa: E402

PATIENCE_S = 120


class Server:
    """litags-server with its page and its data in `folder`."""

    def __init__(self, bin_folder, folder, threads):
        self.bin, self.data = bin_folder, folder / "data"
        files = folder / "port", folder / "web-port"
        more = ("--threads", str(threads)) if threads else ()
        self.log_path = folder / "server.log"
        with open(self.log_path, "wb") as log:
            self.process = subprocess.Popen(
                [self.bin / "litags-server", "--listen", "127.0.0.1:0", "--web", "127.0.0.1:0",
                 "--port-file", files[0], "--web-port-file", files[1], "--data", self.data, *more],
                stdout=log, stderr=log)
        until = time.monotonic() + PATIENCE_S
        while not all(file.exists() and file.read_text() for file in files):
            if self.process.poll() is not None or time.monotonic() > until:
                raise RuntimeError("litags-server does not start")
            time.sleep(0.05)
        self.address = f"127.0.0.1:{int(files[0].read_text())}"
        self.url = f"http://127.0.0.1:{int(files[1].read_text())}"

    def stop(self):
        """SIGTERM; raises if it has ended otherwise, or if a sanitizer has reported."""
        self.process.terminate()
        check_end(self.process.wait(), self.log_path)

    def trained_job(self, capture, iterations=10):
        """A job of so many iterations; its name."""
        out = subprocess.run(
            [self.bin / "litags", "--server", self.address, "submit", capture / "high", "--cameras",
             capture / "transforms_train.json", "--iterations", str(iterations), "--holdout-every", "0", "--watch"],
            check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
        return out.split()[0]

    def scene_of(self, job):
        """The file with the job's scene."""
        database = sqlite3.connect(next(self.data.glob("*.db")))
        (kept,) = database.execute("SELECT kept FROM jobs WHERE id = ?",
                                   (job.removeprefix("jobs/"),)).fetchone()
        text = json.dumps(json.loads(kept)["scene.litags"])
        found = [file for file in self.data.rglob("*") if file.is_file()
                 and file.name in text and len(file.name) >= 32]
        return found[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bin", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("work", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("--gaussians", type=int, default=100000)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--threads", type=int, default=0, help="of the server; 0: all cores")
    args = parser.parse_args()
    why = npm_packages.install(HERE, args.work, ("measure_flight.mjs",))
    if why or not npm_packages.CHROMIUM:
        sys.exit(why or "chromium is not installed")
    with tempfile.TemporaryDirectory(prefix="litags-flight-") as name:
        folder = pathlib.Path(name)
        capture, scene = folder / "capture", folder / "scene.litags"
        quiet = {"check": True, "stdout": subprocess.DEVNULL}
        subprocess.run([args.bin / "litags-sample", capture, "--size", "120x90", "--views", "10"], **quiet)
        subprocess.run([args.bin / "litags-bench", "render", "--gaussians", str(args.gaussians),
                        "--frames", "1", "--save", scene], **quiet)
        server = Server(args.bin, folder, args.threads)
        try:
            job = server.trained_job(capture)
            shutil.copy(scene, server.scene_of(job))
            with urllib.request.urlopen(f"{server.url}/v1/{job}/cameras") as answer:
                shown = int(json.load(answer)["gaussians"])
            if shown != args.gaussians:
                sys.exit(f"the server shows {shown} Gaussians")
            print(f"{shown} Gaussians, {os.cpu_count()} cores", flush=True)
            subprocess.run(
                ["node", args.work / "measure_flight.mjs"], check=True,
                env=dict(os.environ, URL=f"{server.url}/#/{job}/scene", CHROMIUM=npm_packages.CHROMIUM,
                         SECONDS=str(args.seconds), PATIENCE_MS=str(1000 * PATIENCE_S)))
        finally:
            server.stop()


if __name__ == "__main__":
    main()
