"""Load on one server while it trains: watchers, uploads and pictures at once, and what each waits.

Prints a table of calls, rates, latencies and codes, and the server's memory. Ends with an error if
anything failed other than by a limit that the service documents (RESOURCE_EXHAUSTED).

  tests/load/run --watchers 500 --uploads 50 --renderers 8 --seconds 60
"""

import argparse
import asyncio
import collections
import hashlib
import os
import random
import sys
import time

import grpc

import deployment
import harness
from harness import job_pb2, rpc
from litags.v1 import render_service_pb2 as render_pb2

OPTIONS = [("grpc.enable_http_proxy", 0), ("grpc.max_receive_message_length", 64 << 20)]


class Measures:
    """Latencies (s) and codes of calls, by kind."""

    def __init__(self):
        self.latencies = collections.defaultdict(list)
        self.codes = collections.defaultdict(collections.Counter)

    def add(self, kind, seconds, code="OK"):
        self.codes[kind][code] += 1
        if code == "OK":
            self.latencies[kind].append(seconds)

    async def timed(self, kind, call):
        begin = time.monotonic()
        try:
            result = await call
        except grpc.aio.AioRpcError as error:
            self.add(kind, 0, error.code().name)
            return None
        self.add(kind, time.monotonic() - begin)
        return result

    def table(self, seconds):
        lines = ["| Call | Calls | Per second | p50, ms | p99, ms | Refused or failed |",
                 "|---|---:|---:|---:|---:|---|"]
        for kind, codes in self.codes.items():
            sorted_ms = sorted(1000 * s for s in self.latencies[kind])
            at = lambda q: sorted_ms[min(len(sorted_ms) - 1, int(q * len(sorted_ms)))]
            other = ", ".join(f"{n} {code}" for code, n in codes.items() if code != "OK") or "none"
            p50, p99 = (f"{at(.5):.0f}", f"{at(.99):.0f}") if sorted_ms else ("-", "-")
            lines.append(f"| {kind} | {sum(codes.values())} | {codes['OK'] / seconds:.1f} | {p50} "
                         f"| {p99} | {other} |")
        return "\n".join(lines)


def memory_mb(pid):
    """(now, highest) resident memory of a process."""
    with open(f"/proc/{pid}/status") as file:
        kb = {line.split(":")[0]: int(line.split()[1]) for line in file if line.startswith("Vm")}
    return kb["VmRSS"] // 1024, kb["VmHWM"] // 1024


class Load:

    def __init__(self, args, server, job):
        self.args, self.server, self.job = args, server, job
        self.measures = Measures()
        self.faults = []

    def stubs(self):
        """Stubs on a connection of their own: gRPC would share one."""
        channel = grpc.aio.insecure_channel(self.server.address, options=OPTIONS + [
            ("grpc.use_local_subchannel_pool", 1)])
        self.channels.append(channel)
        return (harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel),
                harness.render_service_pb2_grpc.RenderServiceStub(channel))

    async def watch(self, jobs):
        """Follows the job to the end of the load; checks that no number is left out."""
        last = 0
        try:
            async for event in jobs.WatchJob(rpc.WatchJobRequest(name=self.job)):
                if event.number != last + 1:
                    self.faults.append(f"event {event.number} after {last}")
                last = event.number
                made = event.time.seconds + event.time.nanos / 1e9
                if made > self.begin:  # older ones were waiting for us
                    self.measures.add("event, from its writing to a watcher", time.time() - made)
        except asyncio.CancelledError:
            pass
        except grpc.aio.AioRpcError as error:
            self.measures.add("watch", 0, error.code().name)

    async def upload(self, jobs, number):
        """Jobs of four photos, one after the other, deleted again."""
        photos = [(f"{i}.png", harness.png(640, 480, seed=1000 * number + i)) for i in range(4)]
        while time.monotonic() < self.end:
            job = await self.measures.timed("CreateJob", jobs.CreateJob(rpc.CreateJobRequest()))
            if job is None:
                await asyncio.sleep(0.5)
                continue
            await self.measures.timed(
                f"UploadImages, 4 photos, {sum(len(p) for _, p in photos) >> 10} KiB",
                jobs.UploadImages(harness.ServiceTest.upload(job.name, photos, chunk=64 << 10)))
            await self.measures.timed("DeleteJob", jobs.DeleteJob(
                rpc.DeleteJobRequest(name=job.name)))

    async def render(self, pictures, cameras, number):
        """One picture after the other, never waiting between them."""
        chance = random.Random(number)
        while time.monotonic() < self.end:
            request = render_pb2.RenderViewRequest(name=self.job)
            request.pose.camera = chance.choice(cameras)
            request.settings.width = self.args.width
            view = await self.measures.timed(f"RenderView, {self.args.width} px wide",
                                             pictures.RenderView(request))
            if view is None:
                await asyncio.sleep(0.05)

    async def ask(self, jobs):
        """What an impatient user does."""
        while time.monotonic() < self.end:
            await self.measures.timed("GetJob", jobs.GetJob(rpc.GetJobRequest(name=self.job)))
            await asyncio.sleep(0.1)

    async def run(self):
        self.channels = []
        jobs, pictures = self.stubs()
        cameras = (await pictures.ListCameras(render_pb2.ListCamerasRequest(name=self.job))).cameras
        names = [camera.name for camera in cameras]
        quiet = memory_mb(self.server.process.pid)[0]
        first = (await jobs.GetJob(rpc.GetJobRequest(name=self.job))).progress.iteration
        self.begin = time.time()
        self.end = time.monotonic() + self.args.seconds
        # Ten watchers a connection, as clients behind a gateway would come.
        watchers = []
        for i in range(self.args.watchers):
            if i % 10 == 0:
                shared = self.stubs()[0]
            watchers.append(asyncio.create_task(self.watch(shared)))
        work = [self.upload(self.stubs()[0], i) for i in range(self.args.uploads)]
        work += [self.render(self.stubs()[1], names, i) for i in range(self.args.renderers)]
        await asyncio.gather(*work, self.ask(jobs))
        done = await jobs.GetJob(rpc.GetJobRequest(name=self.job))
        for watcher in watchers:
            watcher.cancel()
        await asyncio.gather(*watchers, return_exceptions=True)
        now, highest = memory_mb(self.server.process.pid)
        for channel in self.channels:
            await channel.close()

        print(self.measures.table(self.args.seconds))
        print(f"\n{self.args.watchers} watchers, {self.args.uploads} uploads, "
              f"{self.args.renderers} renderers, {self.args.seconds} s; "
              f"the job trained {done.progress.iteration - first} iterations meanwhile, "
              f"state {job_pb2.JobState.Name(done.state)}")
        print(f"server memory: {quiet} MiB before, {now} MiB after, {highest} MiB at most")
        for kind, codes in self.measures.codes.items():
            for code, count in codes.items():
                if code not in ("OK", "RESOURCE_EXHAUSTED"):
                    self.faults.append(f"{kind}: {count} {code}")
        if done.state not in (harness.RUNNING, harness.SUCCEEDED):
            self.faults.append(f"the job ended as {job_pb2.JobState.Name(done.state)}")
        return self.faults


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--watchers", type=int, default=500)
    parser.add_argument("--uploads", type=int, default=50)
    parser.add_argument("--renderers", type=int, default=8)
    parser.add_argument("--width", type=int, default=320, help="of the pictures, px")
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("server_flags", nargs="*", help="for litags-server, after --")
    args = parser.parse_args()
    with deployment.scratch() as folder:
        server = deployment.Deployment(folder, "--threads", "1", *args.server_flags,
                                       program="litags-server").start()
        client = deployment.Client(server.address)
        try:
            files = deployment.capture(os.path.join(folder, "capture"), views=12, size="320x240")
            job = client.started(files, iterations=1_000_000, preview_every=50,
                                 checkpoint_every=500, threads=1)
            client.wait_for(job, lambda j: j.snapshot_iteration > 0 or j.state == deployment.FINAL[1],
                            "its first snapshot")
            faults = asyncio.run(Load(args, server, job).run())
        finally:
            client.close()
            code, seconds = server.stop()
        print(f"server ended with {code} in {seconds:.1f} s after SIGTERM")
        if code != 0 or server.orphans():
            faults.append(f"exit code {code}, left running: {server.orphans()}")
    for fault in faults:
        print("FAULT:", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
