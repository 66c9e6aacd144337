"""Three servers and four workers on PostgreSQL and S3, as processes on a network of their own."""

import contextlib
import glob
import json
import os
import pwd
import shutil
import signal
import subprocess
import sys
import threading
import time

import deployment
import harness
import network
import s3_client
from deployment import Process
from program_end import check_log

BUCKET = "captures"
PYTHON = "/usr/bin/python3"  # Debian's, which has its packages
SWIFT = os.path.join(os.path.dirname(s3_client.__file__), "swift_server.py")
ACCESS_KEY, SECRET_KEY = "test:litags", "a-secret-of-tests"
# What a kill leaves of a deleted job is removed once it has been quiet for half a minute, and so is
# a job whose upload is: longer than any part of the cluster is away.
SWEEP = ("--keep-uploads", "30", "--sweep-every", "0.5")


def missing():
    """What this machine lacks for a cluster; empty: nothing."""
    if not glob.glob("/usr/lib/postgresql/*/bin/postgres"):
        return "PostgreSQL is not installed"
    if subprocess.run([PYTHON, "-c", "import swift.common.middleware.s3api"],
                      capture_output=True).returncode != 0:
        return "OpenStack Swift (python3-swift) is not installed"
    return ""


class Postgres(Process):
    """PostgreSQL without fsync: it is killed, but the machine goes on."""

    def __init__(self, folder, listen, prefix):
        host, port = listen
        programs = sorted(glob.glob("/usr/lib/postgresql/*/bin"))[-1]
        as_user = []
        if os.geteuid() == 0:  # which PostgreSQL refuses to run as
            user = pwd.getpwnam("postgres")
            for path in (os.path.dirname(folder), folder):
                os.chmod(path, 0o755)
            os.chown(folder, user.pw_uid, user.pw_gid)
            as_user = ["setpriv", "--reuid=postgres", "--regid=postgres", "--init-groups"]
        self.data = os.path.join(folder, "data")
        subprocess.run([*as_user, f"{programs}/initdb", "-D", self.data, "-U", "litags",
                        "--auth=trust", "--encoding=UTF8", "--locale=C.UTF-8", "--no-sync", "-N"],
                       check=True, capture_output=True, cwd="/")
        with open(os.path.join(self.data, "pg_hba.conf"), "a") as rules:
            rules.write("host all all 0.0.0.0/0 trust\n")
        super().__init__(folder, [*as_user, f"{programs}/postgres", "-D", self.data, "-k", folder,
                                  "-p", str(port), "-h", host, "-c", "fsync=off"], prefix=prefix)
        self.host, self.port = host, port

    def ask(self, statement):
        """The rows of a query, as lists of texts."""
        answer = subprocess.run(
            ["psql", "-XAtq", "-F", "\x1f", "-c", statement,
             f"postgresql://litags@{self.host}:{self.port}/postgres?connect_timeout=5"],
            check=True, capture_output=True, text=True, cwd="/", timeout=60)
        return [line.split("\x1f") for line in answer.stdout.splitlines()]

    def kill(self):
        """All of its processes at once, as when a container is killed."""
        for pid in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, 9)
        self.process.wait()
        with contextlib.suppress(FileNotFoundError):
            os.remove(os.path.join(self.data, "postmaster.pid"))


class Cluster:
    """Nodes by name. What dies is started again after a moment, until stop()."""

    def __init__(self, folder, engine, servers=3, workers=4):
        self.folder = folder
        self.net = network.make()
        self.nodes, self.down_until = {}, {}
        self.servers = [f"server{i}" for i in range(servers)]
        self.workers = [f"worker{i}" for i in range(workers)]
        self.stopping = threading.Event()
        try:
            self._make(engine)
        except BaseException:
            self.net.close()
            raise

    def _place(self, node, port):
        """(folder, address, prefix) of a new node."""
        folder = os.path.join(self.folder, node)
        os.mkdir(folder)
        self.net.add(node)
        return folder, self.net.listen(node, port), self.net.prefix(node)

    def _make(self, engine):
        folder, self.postgres_at, prefix = self._place("postgres", 5432)
        self.postgres = self.nodes["postgres"] = Postgres(folder, self.postgres_at, prefix).start()
        folder, self.s3_at, prefix = self._place("s3", 9000)
        host, port = self.s3_at
        self.nodes["s3"] = Process(folder, [PYTHON, SWIFT, folder, f"{host}:{port}", BUCKET],
                                   prefix=prefix, exit_code=-signal.SIGTERM).start()
        program = {"fake": "litags-fake-", "real": "litags-"}[engine]
        for node in [*self.servers, *self.workers]:
            folder, (host, port), prefix = self._place(node, 50051)
            command = [os.path.join(harness.BIN, program + node.rstrip("0123456789")),
                       "--data", os.path.join(folder, "data"), "--threads", "1"]
            if node in self.servers:
                command += ["--listen", f"{host}:{port}", "--insecure", "--workers", "0", *SWEEP]
            else:
                command += ["--keep-every", "2"]
            self.nodes[node] = Process(folder, command, self._environment(node), prefix)
        self._wait("the stores", self._stores_answer)
        for node in [*self.servers, *self.workers]:
            self.nodes[node].start()
        self.keeper = threading.Thread(target=self._keep_alive)
        self.keeper.start()

    def _environment(self, node):
        postgres, s3 = self.net.reach(node, self.postgres_at), self.net.reach(node, self.s3_at)
        return {"LITAGS_STORE": "postgresql://litags@%s:%d/postgres?connect_timeout=3" % postgres,
                "LITAGS_BLOBS": f"s3://{BUCKET}/jobs-of-all", "LITAGS_S3_ENDPOINT": "http://%s:%d" % s3,
                "AWS_ACCESS_KEY_ID": ACCESS_KEY, "AWS_SECRET_ACCESS_KEY": SECRET_KEY,
                "AWS_REGION": s3_client.REGION}

    def _stores_answer(self):
        try:
            self.postgres.ask("SELECT 1")
            self.keys()
            return True
        except (OSError, subprocess.SubprocessError):
            return False

    def _wait(self, what, condition, seconds=120):
        deadline = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > deadline:
                raise deployment.Lost(f"waited in vain for {what}")
            time.sleep(0.1)

    def _keep_alive(self):
        while not self.stopping.wait(0.2):
            for name, node in self.nodes.items():
                if (node.process.poll() is not None and not self.stopping.is_set()
                        and time.monotonic() > self.down_until.get(name, 0)):
                    self.down_until[name] = time.monotonic() + 1  # not in a tight loop
                    node.start()

    def addresses(self):
        return ["%s:%d" % self.net.listen(node, 50051) for node in self.servers]

    # Disturbances.

    def kill(self, node, seconds_down):
        self.down_until[node] = time.monotonic() + seconds_down
        if self.nodes[node].process.poll() is None:
            self.nodes[node].kill()

    def cut(self, node):
        self.net.cut(node)

    def heal(self, node):
        self.net.heal(node)

    # What is there.

    def keys(self):
        """Keys of all blobs but the installation's marker."""
        keys = s3_client.keys("%s:%d" % self.s3_at, BUCKET, ACCESS_KEY, SECRET_KEY)
        return [key for key in keys if not key.startswith("jobs-of-all/installation/")]

    def named(self):
        """Keys that rows name."""
        pairs = [(id, file["blob"]) for id, kept in self.postgres.ask(
            "SELECT id, kept FROM jobs WHERE kept <> ''") for file in json.loads(kept).values()]
        pairs += self.postgres.ask("SELECT job_id, sha256 FROM files")
        for id, payload in self.postgres.ask("SELECT job_id, payload FROM events WHERE kind = 2"):
            if preview := json.loads(payload).get("preview"):
                pairs.append((id, preview))
        return {f"jobs-of-all/jobs/{id}/{blob}" for id, blob in pairs}

    def stray_files(self):
        """Files in the nodes' data folders that belong to no part of the service."""
        found = []
        for node in [*self.servers, *self.workers]:
            data = os.path.join(self.nodes[node].folder, "data")
            found += [os.path.join(folder, name) for folder, _, names in os.walk(data)
                      for name in names if name != "server.lock"]
        return found

    def stop(self):
        """Names of nodes of which processes are left."""
        self.stopping.set()
        self.keeper.join()
        for name in [*self.workers, *self.servers, "s3", "postgres"]:
            node = self.nodes[name]
            if node.process.poll() is None:
                node.stop()
            else:  # killed, or away without its stores
                check_log(node.log_path)
        return [name for name, node in self.nodes.items() if node.orphans()]

    def close(self):
        for name in self.nodes:
            for pid in self.nodes[name].processes():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, 9)
        self.net.close()


@contextlib.contextmanager
def running(engine):
    with deployment.scratch() as folder:
        os.chmod(folder, 0o755)  # PostgreSQL is another user
        cluster = Cluster(folder, engine)
        try:
            yield cluster
        finally:
            try:
                if not cluster.stopping.is_set():
                    cluster.stop()
            finally:
                cluster.close()
                if os.environ.get("LITAGS_KEEP_LOGS"):
                    for name, node in cluster.nodes.items():
                        shutil.copy(node.log_path, os.path.join(os.environ["LITAGS_KEEP_LOGS"],
                                                                f"{name}.log"))
                    print(f"logs in {os.environ['LITAGS_KEEP_LOGS']}", file=sys.stderr)
