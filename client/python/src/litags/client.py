"""The service's calls as Python functions that go on after a broken connection."""

import contextlib
import logging
import os
import pathlib
import secrets
import shutil
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import IO, Any, Self, TypeVar

import grpc

from litags import connection, errors, files, formats
from litags.files import Path
from litags.v1 import job_pb2, model_service_pb2, render_service_pb2
from litags.v1 import model_service_pb2_grpc as models_grpc
from litags.v1 import reconstruction_service_pb2 as rpc
from litags.v1 import reconstruction_service_pb2_grpc as jobs_grpc
from litags.v1 import render_service_pb2_grpc as pictures_grpc

Result = TypeVar("Result")

_log = logging.getLogger("litags")
_FILES_PER_STREAM = 500
_CHANNEL_OPTIONS = [
    ("grpc.max_receive_message_length", 256 << 20),
    ("grpc.initial_reconnect_backoff_ms", 200),
    ("grpc.max_reconnect_backoff_ms", 2000),
    # A peer that died without a word is noticed.
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.http2.max_pings_without_data", 0),
]

_ENDED = (job_pb2.JOB_STATE_SUCCEEDED, job_pb2.JOB_STATE_FAILED, job_pb2.JOB_STATE_CANCELLED)
_START_SECONDS = 5
_LAST_CALL_SECONDS = 5
_LONG_WATCH = 25  # seconds: longer than it takes to find that there is no server


class _Patience:
    """When a call is made again: for the client's `retry_seconds` after something arrived last. A
    server that never answered is tried for a few seconds: it may have been started just now."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._most = -1
        self.start_anew()

    def start_anew(self) -> None:
        self._begun = time.monotonic()
        self._pause = 0.2

    def arrived(self) -> None:
        self._client._answered = True
        self.start_anew()

    def came_to(self, number: int) -> None:
        """Of a try that begins where others did: something arrived, if it came further than they."""
        if number > self._most:
            self._most = number
            self.arrived()

    def wait(self, error: grpc.RpcError) -> None:
        """Returns when it is time for the next attempt, or raises what `error` says."""
        if errors.details(error).details:  # a busy server's, for instance
            self._client._answered = True
        seconds = self._client._retry_seconds
        if not self._client._answered:
            seconds = min(seconds, _START_SECONDS)
        if not errors.may_succeed_later(error) or time.monotonic() - self._begun > seconds:
            answered = self._client._answered
            raise errors.of_call(error, "" if answered else self._client.server) from error
        time.sleep(self._pause)
        self._pause = min(5, 2 * self._pause)


class Client:
    """One server. All errors of calls are LitagsError. Threads may share a client."""

    def __init__(self, server: str = "127.0.0.1:50051", *, token: str | None = None,
                 credentials: grpc.ChannelCredentials | None = None, tls_name: str = "",
                 retry_seconds: float = 300) -> None:
        """`credentials`: grpc.ssl_channel_credentials(...) for a server with TLS. `tls_name`: the
        name in the server's certificate, if it is not that of `server`. `retry_seconds`: how long
        calls are repeated while a server that did answer does not. ValueError: a `token` without
        `credentials`, for a server on another machine."""
        options = list(_CHANNEL_OPTIONS)
        if connection.is_this_machine(server):  # a proxy for the internet is no way to it
            options.append(("grpc.enable_http_proxy", 0))
        elif token and not credentials:
            raise ValueError(f"the token would travel to {server} unencrypted; give credentials, or "
                             "set LITAGS_TLS=1, or LITAGS_TLS_CA to the file of the server's "
                             "authority, for Client.from_environment")
        if tls_name:
            options.append(("grpc.ssl_target_name_override", tls_name))
        self.server = server
        self.channel = (grpc.secure_channel(server, credentials, options) if credentials
                        else grpc.insecure_channel(server, options))
        # For calls without a function here: client.jobs.GetLog(request, metadata=client.metadata).
        self.jobs = jobs_grpc.ReconstructionServiceStub(self.channel)
        self.pictures = pictures_grpc.RenderServiceStub(self.channel)
        self.models = models_grpc.ModelServiceStub(self.channel)
        self.metadata = (("authorization", f"Bearer {token}"),) if token else ()
        self._retry_seconds = retry_seconds
        self._answered = False

    @classmethod
    def from_environment(cls, server: str = "", *, retry_seconds: float = 300) -> Self:
        """A client of the server, and with the token and TLS, that the program `litags` would use:
        by LITAGS_SERVER, LITAGS_TOKEN, LITAGS_TLS_CA and others (docs/languages.md)."""
        return cls(**connection.options_of(os.environ, server), retry_seconds=retry_seconds)

    def close(self) -> None:
        self.channel.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def submit(self, photos: Path | Iterable[Path], *,
               options: job_pb2.JobOptions | Mapping[str, Any] | None = None,
               labels: Mapping[str, str] | None = None, cameras: Path | None = None,
               masks: Path | None = None, depth: Path | None = None, title: str = "",
               strict: bool = False, request_id: str = "") -> str:
        """Sends photos, starts the job and returns its name. `photos`: a folder, a list, a video,
        or an archive of a folder. `cameras`: what `litags submit --cameras` takes (docs/cameras.md).
        `masks`: a folder; without one, that of the name "masks" in the folder of photos, if it is
        there. `depth`: a folder of depth maps. A photo that cannot be read or sent is left out and
        logged as a warning; `strict` refuses it, but of an archive. Removes a job that is refused or
        interrupted, unless there is a `request_id`: the same call with the same one goes on with one
        job."""
        found = files.find_photos(photos)
        if cameras is not None:
            found += files.find_cameras(cameras)
        if masks is None and (masks := files.masks_beside(photos)) is not None:
            _log.info("masks: %s", masks)
        if masks is not None:
            found += files.find_masks(masks)
        if depth is not None:
            found += files.find_depth(depth)
        found = files.sendable(found, strict)
        if not isinstance(options, job_pb2.JobOptions):
            options = job_pb2.JobOptions(**options or {})
        # With a request_id a repeated call makes no second job, and no second start.
        request = rpc.CreateJobRequest(request_id=request_id or str(uuid.uuid4()),
                                       display_name=title, options=options, labels=labels or {},
                                       content_digest=files.content_digest(found))
        created = self._call(self.jobs.CreateJob, request)
        job = created.name
        if created.state != job_pb2.JOB_STATE_UPLOADING:  # submitted before
            return job
        starting = False
        try:
            for turn in files.turns(found):
                self._upload_all(job, turn, strict)
            starting = True
            self._call(self.jobs.StartJob,
                       rpc.StartJobRequest(name=job, request_id=str(uuid.uuid4())))
        except errors.LitagsError as error:
            if error.may_succeed_later or (starting and not error.is_answer):
                raise errors.of_left_job(error, job, request.request_id, starting) from error
            if not request_id:  # refused: nobody goes on with it
                with contextlib.suppress(errors.LitagsError):
                    self._call(self.jobs.DeleteJob,
                               rpc.DeleteJobRequest(name=job, allow_missing=True))
            raise
        except BaseException:  # interrupted, or a file is gone
            if starting:
                _log.warning("%s", errors.left_job(job, request.request_id, starting))
            elif not request_id:
                with contextlib.suppress(grpc.RpcError):  # one try: the user waits for the end
                    self.jobs.DeleteJob(rpc.DeleteJobRequest(name=job, allow_missing=True),
                                        metadata=self.metadata, timeout=_LAST_CALL_SECONDS)
            raise
        return job

    def job(self, job: str) -> job_pb2.Job:
        """What the service knows of a job: state, progress, report."""
        return self._call(self.jobs.GetJob, rpc.GetJobRequest(name=_name(job)))

    def watch(self, job: str, *, after: int = 0) -> Iterator[job_pb2.JobEvent]:
        """A job's events after number `after` until it has ended, each once."""
        patience = _Patience(self)
        while True:
            begun = time.monotonic()
            events = self.jobs.WatchJob(rpc.WatchJobRequest(name=_name(job), after_event=after),
                                        metadata=self.metadata)
            try:
                for event in events:
                    yield event
                    after = event.number
                    patience.arrived()
                return
            except grpc.RpcError as error:
                # A watch of a quiet job is as good as one that brought something.
                if time.monotonic() - begun > _LONG_WATCH:
                    patience.start_anew()
                patience.wait(error)
            finally:
                events.cancel()

    def wait(self, job: str, *, progress: bool = True) -> job_pb2.Job:
        """Returns the job when it has succeeded; one that failed or was cancelled is a LitagsError.
        `progress`: a bar on stderr, if tqdm is installed."""
        last = 0
        with _progress_bar(job, progress) as show:
            while True:
                for event in self.watch(job, after=last):
                    last = event.number
                    if event.HasField("progress"):
                        show(event.progress)
                found = self.job(job)
                if found.state in _ENDED:
                    break
                time.sleep(0.2)  # it was resumed just after it had ended
        errors.raise_unless_succeeded(found)
        return found

    def cameras(self, job: str) -> list[str]:
        """Names of the photos whose cameras were found: what `render` takes."""
        request, names = render_service_pb2.ListCamerasRequest(name=_name(job)), []
        while True:
            page = self._call(self.pictures.ListCameras, request)
            names += [camera.name for camera in page.cameras]
            if not page.next_page_token:
                return names
            request.page_token = page.next_page_token

    def view(self, job: str, camera: str = "", *,
             pose: render_service_pb2.Pose | None = None,
             **settings: Any) -> render_service_pb2.RenderedView:
        """A picture (PNG unless `format` says otherwise) with its size and range of values, from the
        camera of the photo of this name or from a pose. `settings`: fields of RenderSettings, as
        width=640 or channel="CHANNEL_DEPTH"."""
        if camera and pose is not None:
            raise ValueError("camera and pose both say from where; give one of them")
        request = render_service_pb2.RenderViewRequest(
            name=_name(job), pose=pose or render_service_pb2.Pose(camera=camera),
            settings=render_service_pb2.RenderSettings(**settings))
        return self._call(self.pictures.RenderView, request)

    def render(self, job: str, camera: str = "", *,
               pose: render_service_pb2.Pose | None = None, **settings: Any) -> bytes:
        """The bytes of view()."""
        return self.view(job, camera, pose=pose, **settings).data

    def export(self, job: str, path: Path, **settings: Any) -> None:
        """Writes the scene to a file, whole or not at all, in the format that its name says or
        `format`. A link stays one; a device or a pipe gets the bytes. `settings`: fields of
        ExportModelRequest, as format="MODEL_FORMAT_SPZ_V4". ValueError: a name that says no format,
        or another than `format`."""
        request = model_service_pb2.ExportModelRequest(name=_name(job), **settings)
        if request.format:
            formats.check_ending(path, request.format)
        else:
            request.format = formats.model_format(path)
        if pathlib.Path(path).exists() and not pathlib.Path(path).is_file():
            with tempfile.TemporaryFile() as scene, open(path, "wb") as sink:
                self._export(request, scene)
                scene.seek(0)
                shutil.copyfileobj(scene, sink)
            return
        target = pathlib.Path(path).resolve()
        part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
        try:
            with part.open("xb") as file:
                self._export(request, file)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)

    def _export(self, request: model_service_pb2.ExportModelRequest, file: IO[bytes]) -> None:
        def write(patience: _Patience) -> None:
            file.seek(0)
            file.truncate()
            for message in self.models.ExportModel(request, metadata=self.metadata):
                file.write(message.chunk)
                patience.came_to(file.tell())

        self._persistently(write)

    def _upload_all(self, job: str, found: list[files.File], strict: bool) -> None:
        start = 0
        while start < len(found):
            try:
                self._upload(job, found[start:start + _FILES_PER_STREAM])
                start += _FILES_PER_STREAM
            except errors.LitagsError as error:
                photo = None if strict else files.refused_photo(found, error)
                if photo is None:
                    raise
                found = files.leave_out(photo, error.message, found)

    def _upload(self, job: str, batch: list[files.File]) -> None:
        query = rpc.QueryUploadRequest(name=job, files=[file.header() for file in batch])

        def send(patience: _Patience) -> None:
            known = self.jobs.QueryUpload(query, metadata=self.metadata).files
            reached = sum(file.size if status.stored else status.offset
                          for file, status in zip(batch, known, strict=True))
            missing = [(file, status.offset) for file, status in zip(batch, known, strict=True)
                       if not status.stored]
            if not missing:
                return

            def counted() -> Iterator[rpc.UploadImagesRequest]:
                nonlocal reached
                for message in files.upload_messages(job, *zip(*missing)):
                    yield message
                    reached += len(message.chunk)

            try:
                stored = self._send(counted())
                for note in stored.skipped:
                    _log.warning("not used, of what is in the archive: %s", note)
                if (unnamed := stored.skipped_total - len(stored.skipped)) > 0:
                    _log.warning("not used, of what is in the archive: %d more", unnamed)
            except grpc.RpcError:
                patience.came_to(reached)  # bytes arrived, though the stream broke
                raise

        self._persistently(send)

    def _send(self, messages: Iterator[rpc.UploadImagesRequest]) -> rpc.UploadImagesResponse:
        """Raises what the messages raise: gRPC would say only that it could not iterate."""
        unreadable: list[Exception] = []

        def readable() -> Iterator[rpc.UploadImagesRequest]:
            try:
                yield from messages
            except (OSError, ValueError) as error:
                unreadable.append(error)

        response = rpc.UploadImagesResponse()
        upload = self.jobs.UploadImages.future(readable(), metadata=self.metadata)
        try:
            response = upload.result()
        except grpc.RpcError:
            if not unreadable:
                raise
        finally:
            upload.cancel()  # where the wait was interrupted
        if unreadable:
            raise unreadable[0]
        return response

    def _call(self, method: Callable[..., Result], request: object) -> Result:
        return self._persistently(lambda _: method(request, metadata=self.metadata))

    def _persistently(self, call: Callable[[_Patience], Result]) -> Result:
        patience = _Patience(self)
        while True:
            try:
                result = call(patience)
                patience.arrived()
                return result
            except grpc.RpcError as error:
                patience.wait(error)


def _name(job: str) -> str:
    """The name of a job whose ID alone may be given, as to `litags`."""
    return job if job.startswith("jobs/") else f"jobs/{job}"


@contextlib.contextmanager
def _progress_bar(job: str, wanted: bool) -> Iterator[Callable[[job_pb2.Progress], None]]:
    try:
        from tqdm import tqdm
    except ImportError:
        wanted = False
    if not wanted:
        yield lambda _: None
        return
    with tqdm(desc=job, unit=" iterations") as bar:
        def show(step: job_pb2.Progress) -> None:
            bar.total = step.iterations or None
            bar.set_postfix_str(step.message or job_pb2.Stage.Name(step.stage), refresh=False)
            bar.update(step.iteration - bar.n)

        yield show
