"""All attacks at once beside honest clients, on one server with the fake engine.

    tests/attack/run [--minutes M] [--honest N] [--connections N] [--kinds KIND...] [-- SERVER FLAGS]

Strangers attack by service/hostile.py, a client with a token by with_token.py, all at niceness 10,
since they would not be on the server's machine. Prints what the honest clients got and the server's
peak memory. Ends with an error if a call of theirs failed, or the server took more than --max-mib.
"""

import argparse
import collections
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time

import grpc

import harness
import with_token
from harness import rpc
from security_test import run_server

HERE = os.path.dirname(os.path.abspath(__file__))
STRANGERS = ("idle", "handshake", "headers", "unended", "opened", "gzip", "client")
KINDS = (*STRANGERS, *with_token.KINDS)
OPTIONS = [("grpc.enable_http_proxy", 0), ("grpc.use_local_subchannel_pool", 1)]
CALLS_OF_A_JOB = 10


def new_token(name, tokens):
    code, out, err = run_server("token", name, "--tokens", tokens)
    if code != 0:
        raise RuntimeError(err)
    return out.strip()


class Client:
    """One token's calls, each measured."""

    def __init__(self, address, token):
        self.address, self.metadata = address, [("authorization", f"Bearer {token}")]
        self.seconds = collections.defaultdict(list)
        self.failures = []
        self.connect()

    def connect(self):
        self.channel = grpc.insecure_channel(self.address, OPTIONS)
        self.jobs = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(self.channel)

    def call(self, name, request):
        begin = time.monotonic()
        answer = getattr(self.jobs, name)(request, metadata=self.metadata,
                                          timeout=harness.PATIENCE_S)
        self.seconds[name].append(time.monotonic() - begin)
        return answer

    def job_with_photos(self, seed):
        job = self.call("CreateJob", rpc.CreateJobRequest()).name
        files = [(f"{i}.png", harness.png(seed=seed + i)) for i in range(3)]
        stored = self.call("UploadImages", harness.ServiceTest.upload(job, files)).files_stored
        if stored != len(files):
            self.failures.append(f"{stored} of {len(files)} photos stored")
        return job

    def one_job(self, seed):
        job = self.job_with_photos(seed)
        for _ in range(CALLS_OF_A_JOB):
            self.call("GetJob", rpc.GetJobRequest(name=job))
            time.sleep(0.1)
        self.call("DeleteJob", rpc.DeleteJobRequest(name=job))

    def run(self, end, seed):
        turn = 0
        while time.monotonic() < end:
            turn += 1
            try:
                self.one_job(1000 * seed + turn)
            except grpc.RpcError as error:
                self.failures.append(f"{error.code().name}: {error.details()}")
            if turn % 5 == 0:  # as clients come and go
                self.channel.close()
                self.connect()
        self.channel.close()


def finished_job(server, token):
    """One with events, previews and a scene, for attacks on answers."""
    client = Client(server.address, token)
    job = client.job_with_photos(0)
    client.call("StartJob", rpc.StartJobRequest(name=job))
    for _ in client.jobs.WatchJob(rpc.WatchJobRequest(name=job), metadata=client.metadata,
                                  timeout=harness.PATIENCE_S):
        pass
    client.channel.close()
    return job


def attackers(args, server, token, job, seconds):
    def start(kind):
        program, *options = (
            ("../service/hostile.py", "--connections", str(args.connections))
            if kind in STRANGERS else ("with_token.py", "--job", job))
        return subprocess.Popen(
            ["nice", "-n", "10", sys.executable, "-B", os.path.join(HERE, program), kind,
             str(server.port), *options, "--token", token, "--seconds", str(seconds)],
            stdout=subprocess.PIPE, text=True)
    return {kind: start(kind) for kind in args.kinds}


def report(honest, server):
    names = sorted({name for client in honest for name in client.seconds})
    print("| Call | Calls | p50, ms | p99, ms |\n|---|---:|---:|---:|")
    for name in names:
        ms = [1000 * s for client in honest for s in client.seconds[name]]
        p50, p99 = (harness.quantile(ms, share) for share in (.5, .99))
        print(f"| {name} | {len(ms)} | {p50:.0f} | {p99:.0f} |")
    failures = [failure for client in honest for failure in client.failures]
    print(f"failed: {len(failures)}")
    for text, count in collections.Counter(failures).most_common(10):
        print(f"  {count} times {text}")
    peak, now = (harness.memory_mib(server.process.pid, key) for key in ("VmHWM", "VmRSS"))
    print(f"server: peak {peak} MiB, at the end {now} MiB")
    return len(failures), peak


def attack(args, folder):
    tokens = os.path.join(folder, "tokens")
    own = [new_token(f"honest{i}", tokens) for i in range(args.honest)]
    hostile = new_token("mallory", tokens)
    server = harness.Server(folder, extra=("--workers", "1", "--tokens", tokens,
                                           *args.server_flags))
    try:
        job = finished_job(server, hostile)
        seconds = 60 * args.minutes
        honest = [Client(server.address, token) for token in own]
        hostile = attackers(args, server, hostile, job, seconds)
        end = time.monotonic() + seconds
        threads = [threading.Thread(target=client.run, args=(end, i))
                   for i, client in enumerate(honest)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for attacker in hostile.values():
            print(attacker.communicate()[0], end="")
        broken = [kind for kind, attacker in hostile.items() if attacker.returncode != 0]
        failures, peak = report(honest, server)
        if broken:
            print("attacks that did not run to their end:", *broken)
        # A sanitizer's own memory is a multiple of the server's.
        greedy = harness.SLOWER == 1 and peak > args.max_mib
        return 1 if failures or broken or greedy else 0
    finally:
        server.stop()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--honest", type=int, default=20)
    parser.add_argument("--connections", type=int, default=40, help="of each kind of strangers")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--max-mib", type=int, default=1024)
    parser.add_argument("server_flags", nargs="*", help="after --")
    args = parser.parse_args()
    folder = tempfile.mkdtemp(prefix="litags-attack-")
    try:
        return attack(args, folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
