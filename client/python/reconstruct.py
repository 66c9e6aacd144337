#!/usr/bin/env python3
"""A folder of badly lit photos becomes a picture in normal light, and a scene for viewers.

    pip install ./client/python      # docs/languages.md
    client/python/reconstruct.py night_photos/ view.png scene.ply

Exit status: 1 if the service refused something or the job failed.
"""

import argparse
import pathlib
import sys

from litags import Client, LitagsError, model_format
from litags.v1 import job_pb2

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("photos", type=pathlib.Path, help="folder")
parser.add_argument("picture", type=pathlib.Path, help="PNG to write: the first photo's view")
parser.add_argument("scene", type=pathlib.Path, nargs="?", help="file to write: .ply, .spz, ...")
parser.add_argument("--server", default="",
                    help="HOST:PORT; default: LITAGS_SERVER, or this machine's")
parser.add_argument("--iterations", type=int, help="default: the server's")
args = parser.parse_args()


def text_of(event: job_pb2.JobEvent) -> str:
    if event.HasField("state_change"):
        change = event.state_change
        return f"{job_pb2.JobState.Name(change.state)} {change.message}"
    step = event.progress
    done = f"{step.iteration} of {step.iterations} " if step.iteration else ""
    return f"{job_pb2.Stage.Name(step.stage)} {done}{step.message}"


try:
    # What is wrong with the files to write is said now, not after hours.
    if args.scene:
        model_format(args.scene)
    for file in filter(None, (args.picture, args.scene)):
        file.parent.stat()
    with Client.from_environment(args.server) as client:  # also LITAGS_TOKEN, LITAGS_TLS_CA, ...
        job = client.submit(args.photos, options=job_pb2.JobOptions(iterations=args.iterations))
        print(job)  # goes on whatever becomes of this program: litags watch
        said = ""
        for event in client.watch(job):  # goes on after a broken connection
            if not event.HasField("snapshot") and text_of(event) != said:
                said = text_of(event)
                print(said)
        client.wait(job)  # raises if it failed
        camera = client.cameras(job)[0]
        args.picture.write_bytes(client.render(job, camera))
        if args.scene:
            client.export(job, args.scene)
        print(f"{args.picture}: {camera} in normal light; {job}")
except (LitagsError, OSError, ValueError) as error:
    sys.exit(str(error))
