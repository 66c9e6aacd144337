#!/usr/bin/env python3
"""A folder of badly lit photos becomes a picture in normal light: a whole client, to be copied.

    mkdir stubs
    protoc -I proto --python_out=stubs --grpc_out=stubs \\
        --plugin=protoc-gen-grpc=$(which grpc_python_plugin) proto/litags/v1/*.proto
    PYTHONPATH=stubs client/python/reconstruct.py night_photos/ view.png

Needs grpcio (Debian: python3-grpcio). Connections may break at any time: uploads go on inside a
file, watches after the last event. Exit status: 1 if the service refused something or the job failed.
"""

import argparse
import hashlib
import os
import pathlib
import sys
import time
import uuid

import grpc
from litags.v1 import errors_pb2 as errors
from litags.v1 import job_pb2 as job_types
from litags.v1 import reconstruction_service_pb2 as rpc
from litags.v1 import reconstruction_service_pb2_grpc
from litags.v1 import render_service_pb2 as render
from litags.v1 import render_service_pb2_grpc

# As the service takes them: kPhotoEndings in proto/litags/v1/limits.h.
PHOTO_ENDINGS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".heic", ".heif", ".hif", ".avif", ".jxl", ".dng",
                 ".nef", ".nrw", ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw")
ATTEMPTS = 60  # in a row, five seconds apart at most


def persistently(call):
    """The result of `call(arrived)`, made again while no server answers; `arrived()` says that
    something did come, so that a connection of hours may break often."""
    failures = 0

    def arrived():
        nonlocal failures
        failures = 0

    while True:
        try:
            return call(arrived)
        except grpc.RpcError as error:
            failures += 1
            if error.code() != grpc.StatusCode.UNAVAILABLE or failures >= ATTEMPTS:
                raise
            time.sleep(min(5, failures))


def upload(jobs, job, photos):
    """Sends what the server does not have of the photos yet."""
    headers = [rpc.FileHeader(name=photo.name, size_bytes=photo.stat().st_size,
                              sha256=hashlib.sha256(photo.read_bytes()).digest())
               for photo in photos]

    def messages(known):
        yield rpc.UploadImagesRequest(name=job)
        for photo, header, status in zip(photos, headers, known):
            if status.stored:
                continue
            header.offset = status.offset
            yield rpc.UploadImagesRequest(file=header)
            with open(photo, "rb") as file:
                file.seek(status.offset)
                while chunk := file.read(256 << 10):
                    yield rpc.UploadImagesRequest(chunk=chunk)
        # Without its end a stream that was cut short looks whole.
        yield rpc.UploadImagesRequest(end=rpc.UploadEnd(files=unsent(known)))

    def unsent(known):
        return sum(not status.stored for status in known)

    def send(_):
        known = jobs.QueryUpload(rpc.QueryUploadRequest(name=job, files=headers)).files
        received = jobs.UploadImages(messages(known)).files_received
        if received != unsent(known):
            sys.exit(f"{job}: the server has {received} of {unsent(known)} photos that were sent")

    persistently(send)


def watch(jobs, job):
    """Prints what happens until the job has ended; returns its last change of state."""
    last, change = 0, None

    def follow(arrived):
        nonlocal last, change
        for event in jobs.WatchJob(rpc.WatchJobRequest(name=job, after_event=last)):
            arrived()
            last = event.number
            if event.HasField("state_change"):
                change = event.state_change
                print(job_types.JobState.Name(change.state), change.message)
            elif event.HasField("progress"):
                step = event.progress
                print(job_types.Stage.Name(step.stage), step.message, step.iteration, "of",
                      step.iterations)

    persistently(follow)
    return change


def error_detail(error):
    """Reason and field of a failed call: for programs, where the message is for people."""
    for key, value in error.trailing_metadata() or ():
        if key == "grpc-status-details-bin":
            for packed in errors.RpcStatus.FromString(value).details:
                detail = errors.ErrorDetail()
                if packed.Unpack(detail):
                    return detail
    return errors.ErrorDetail()


def reconstruct(channel, photos, picture, iterations):
    jobs = reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel)
    renderer = render_service_pb2_grpc.RenderServiceStub(channel)
    # With a request_id a repeated call makes no second job.
    request = rpc.CreateJobRequest(request_id=str(uuid.uuid4()),
                                   options=job_types.JobOptions(iterations=iterations))
    job = persistently(lambda _: jobs.CreateJob(request)).name
    upload(jobs, job, photos)
    jobs.StartJob(rpc.StartJobRequest(name=job))
    change = watch(jobs, job)
    if change.state != job_types.JOB_STATE_SUCCEEDED:
        detail = change.error.detail
        sys.exit(f"{job}: {change.error.message} ({detail.reason}, field {detail.field})")
    view = persistently(lambda _: renderer.RenderView(render.RenderViewRequest(
        name=job, pose=render.Pose(camera=photos[0].name))))
    picture.write_bytes(view.data)
    print(f"{picture}: {view.width}x{view.height}, {photos[0].name} in normal light; {job}")


def is_utf8(name):
    try:
        return bool(name.encode())
    except UnicodeEncodeError:
        return False


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", type=pathlib.Path, help="folder of photos")
    parser.add_argument("picture", type=pathlib.Path, help="PNG to write: the first photo's view")
    parser.add_argument("--server", default="127.0.0.1:50051", help="HOST:PORT")
    parser.add_argument("--iterations", type=int, help="default: the server's")
    args = parser.parse_args()
    photos = sorted(path for path in args.photos.iterdir()
                    if path.suffix.lower() in PHOTO_ENDINGS)
    if not photos:
        parser.error(f"{args.photos} holds no photo ({' '.join(PHOTO_ENDINGS)})")
    for photo in photos:
        if not is_utf8(photo.name):
            parser.error(f"{os.fsencode(photo)!r}: the file's name is not UTF-8; rename it")
    # With TLS: grpc.secure_channel(args.server, grpc.ssl_channel_credentials(...)).
    with grpc.insecure_channel(args.server) as channel:
        try:
            reconstruct(channel, photos, args.picture, args.iterations)
        except grpc.RpcError as error:
            detail = error_detail(error)
            sys.exit(f"{error.details()}\n  {error.code().name} {detail.reason}, field {detail.field}")


if __name__ == "__main__":
    main()
