"""Load on one server while it trains: watchers, uploads and pictures at once, and what each waits.

Prints a table of calls, rates, latencies and codes, and the server's memory. Ends with an error if
anything failed other than by a limit that the service documents (RESOURCE_EXHAUSTED).

  tests/load/run --watchers 500 --uploads 50 --renderers 8 --seconds 60
"""

import argparse
import asyncio
import collections
import concurrent.futures
import itertools
import multiprocessing
import os
import random
import sys
import time

import grpc

import deployment
import harness
from harness import job_pb2, rpc
from litags.v1 import render_service_pb2 as render_pb2

WATCH_PROCESSES = 5
OPTIONS = [("grpc.enable_http_proxy", 0), ("grpc.max_receive_message_length", 64 << 20)]


class Measures:
    """Latencies (s) and codes of calls, by kind."""

    def __init__(self):
        self.latencies = collections.defaultdict(list)
        self.codes = collections.defaultdict(collections.Counter)

    def join(self, other):
        for kind, codes in other.codes.items():
            self.codes[kind].update(codes)
            self.latencies[kind] += other.latencies[kind]

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
            ms = [1000 * s for s in self.latencies[kind]]
            other = ", ".join(f"{n} {code}" for code, n in codes.items() if code != "OK") or "none"
            p50, p99 = (f"{harness.quantile(ms, share):.0f}" if ms else "-" for share in (.5, .99))
            lines.append(f"| {kind} | {sum(codes.values())} | {codes['OK'] / seconds:.1f} | {p50} "
                         f"| {p99} | {other} |")
        return "\n".join(lines)


class Part:
    """One kind of clients in a process of its own, so that they do not wait for each other."""

    def __init__(self, args, address, job, last_event):
        self.args, self.address, self.job, self.last_event = args, address, job, last_event
        self.measures = Measures()
        self.faults = []
        self.channels = []
        self.end = time.monotonic() + args.seconds

    def stubs(self):
        """Stubs on a connection of their own: gRPC would share one."""
        channel = grpc.aio.insecure_channel(self.address, options=OPTIONS + [
            ("grpc.use_local_subchannel_pool", 1)])
        self.channels.append(channel)
        return (harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel),
                harness.render_service_pb2_grpc.RenderServiceStub(channel))

    async def watch(self, jobs):
        """Follows the job to the end of the load; checks that no number is left out."""
        last = self.last_event
        request = rpc.WatchJobRequest(name=self.job, after_event=last)
        stream = jobs.WatchJob(request)
        try:
            while True:
                left = self.end - time.monotonic()
                event = await asyncio.wait_for(stream.read(), max(left, 0.001))
                if event is grpc.aio.EOF or event.number != last + 1:
                    self.faults.append(f"after event {last} came {event}")
                    return
                last = event.number
                made = event.time.seconds + event.time.nanos / 1e9
                self.measures.add("event, from its writing to a watcher", time.time() - made)
        except asyncio.TimeoutError:
            stream.cancel()
        except grpc.aio.AioRpcError as error:
            self.measures.add("watch", 0, error.code().name)
        if last == self.last_event and self.args.seconds >= 10:
            self.faults.append("a watcher saw nothing")

    async def watch_all(self, count):
        # Ten watchers a connection, as clients behind a gateway would come.
        shared = [self.stubs()[0] for _ in range((count + 9) // 10)]
        await asyncio.gather(*(self.watch(shared[i // 10]) for i in range(count)))

    async def upload(self, jobs, number):
        """Jobs of four photos, one after the other, deleted again."""
        for turn in itertools.count():
            photos = [(f"{i}.png", harness.large_png(10000 * number + 10 * turn + i, 400, 300))
                      for i in range(4)]
            if time.monotonic() > self.end:
                return
            job = await self.measures.timed("CreateJob", jobs.CreateJob(rpc.CreateJobRequest()))
            if job is None:
                await asyncio.sleep(0.5)
                continue
            await self.measures.timed(
                f"UploadImages, 4 photos, {sum(len(data) for _, data in photos) >> 10} KiB",
                jobs.UploadImages(harness.ServiceTest.upload(job.name, photos, chunk=64 << 10)))
            await self.measures.timed("DeleteJob", jobs.DeleteJob(
                rpc.DeleteJobRequest(name=job.name)))

    async def upload_all(self, count):
        await asyncio.gather(*(self.upload(self.stubs()[0], i) for i in range(count)))

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

    async def render_all(self, count):
        request = render_pb2.ListCamerasRequest(name=self.job)
        cameras = [c.name for c in (await self.stubs()[1].ListCameras(request)).cameras]
        await asyncio.gather(*(self.render(self.stubs()[1], cameras, i) for i in range(count)))

    async def ask_all(self, _):
        """What an impatient user does."""
        jobs = self.stubs()[0]
        while time.monotonic() < self.end:
            await self.measures.timed("GetJob", jobs.GetJob(rpc.GetJobRequest(name=self.job)))
            await asyncio.sleep(0.1)

    async def run(self, kind, count):
        await getattr(self, kind + "_all")(count)
        for channel in self.channels:
            await channel.close()


def run_part(kind, count, *where):
    """(Measures, faults) of `count` clients of a kind."""
    part = Part(*where)
    asyncio.run(part.run(kind, count))
    return part.measures, part.faults


def run_load(args, server, client, job):
    """Faults of the whole load; prints what was measured."""
    before = client.get(job)
    quiet = harness.memory_mib(server.process.pid, "VmRSS")
    where = (args, server.address, job, before.last_event)
    kinds = [("upload", args.uploads), ("render", args.renderers), ("ask", 1)]
    kinds += [("watch", args.watchers // WATCH_PROCESSES)] * WATCH_PROCESSES
    measures, faults = Measures(), []
    spawn = multiprocessing.get_context("spawn")  # gRPC does not survive a fork
    with concurrent.futures.ProcessPoolExecutor(len(kinds), mp_context=spawn) as pool:
        parts = [pool.submit(run_part, kind, count, *where) for kind, count in kinds]
        for part in parts:
            measured, found = part.result()
            measures.join(measured)
            faults += found
    done = client.get(job)
    now, highest = (harness.memory_mib(server.process.pid, key) for key in ("VmRSS", "VmHWM"))
    print(measures.table(args.seconds))
    print(f"\n{args.watchers} watchers, {args.uploads} uploads, "
          f"{args.renderers} renderers, {args.seconds} s; the job trained "
          f"{done.progress.iteration - before.progress.iteration} iterations meanwhile, "
          f"state {job_pb2.JobState.Name(done.state)}")
    print(f"server memory: {quiet} MiB before, {now} MiB after, {highest} MiB at most")
    for kind, codes in measures.codes.items():
        for code, count in codes.items():
            if code not in ("OK", "RESOURCE_EXHAUSTED"):
                faults.append(f"{kind}: {count} {code}")
    if done.state not in (harness.RUNNING, harness.SUCCEEDED):
        faults.append(f"the job ended as {job_pb2.JobState.Name(done.state)}")
    return faults


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--watchers", type=int, default=500)
    parser.add_argument("--uploads", type=int, default=50)
    parser.add_argument("--renderers", type=int, default=8)
    parser.add_argument("--width", type=int, default=320, help="of the pictures, px")
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--preview-every", type=int, default=200,
                        help="iterations between snapshots; the first starts the load")
    parser.add_argument("server_flags", nargs="*", help="for litags-server, after --")
    args = parser.parse_args()
    with deployment.scratch() as folder:
        server = deployment.Deployment(folder, "--threads", "1", "--max-iterations", "0",
                                       *args.server_flags,
                                       program="litags-server").start()
        client = deployment.Client(server.address)
        try:
            files = deployment.capture(os.path.join(folder, "capture"), views=12, size="320x240")
            job = client.started(files, iterations=1_000_000, preview_every=args.preview_every,
                                 checkpoint_every=200, threads=1)
            client.wait_for(job, lambda j: j.snapshot_iteration > 0 or j.state == deployment.FINAL[1],
                            "its first snapshot")
            faults = run_load(args, server, client, job)
        finally:
            client.close()
            seconds = server.stop()
        print(f"server ended {seconds:.1f} s after SIGTERM")
        if left := server.orphans():
            faults.append(f"left running: {left}")
    for fault in faults:
        print("FAULT:", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
