"""What the service answers when it refuses a call, or when a job has failed."""

import grpc

from litags.v1 import errors_pb2, job_pb2

_CODES = {code.value[0]: code for code in grpc.StatusCode}
# What came is kept, and another stream sends the rest.
_BROKEN_UPLOADS = ("UPLOAD_STALLED", "OFFSET_INVALID")


class LitagsError(Exception):
    """A refused call, a failed job, or a server that does not answer."""

    def __init__(self, code: grpc.StatusCode, reason: str, field: str, message: str,
                 may_succeed_later: bool = False) -> None:
        super().__init__(message)
        self.code = code
        self.reason = reason  # for programs: docs/errors.md
        self.field = field  # the input at fault, or ""
        self.message = message  # for people: what is wrong, and what to do
        self.may_succeed_later = may_succeed_later  # the same, made again

    @property
    def is_answer(self) -> bool:
        """Whether the service said it, and not gRPC, which knows no reasons."""
        return self.reason != self.code.name

    def __str__(self) -> str:
        field = f", field {self.field}" if self.field else ""
        reason = f" {self.reason}" if self.is_answer else ""
        return f"{self.message}\n  {self.code.name}{reason}{field}"


def details(error: grpc.RpcError) -> errors_pb2.RpcStatus:
    for key, value in error.trailing_metadata() or ():
        if key == "grpc-status-details-bin":
            return errors_pb2.RpcStatus.FromString(value)
    return errors_pb2.RpcStatus()


def _detail(error: grpc.RpcError) -> errors_pb2.ErrorDetail:
    detail = errors_pb2.ErrorDetail(reason=error.code().name)
    for packed in details(error).details:
        if packed.Is(errors_pb2.ErrorDetail.DESCRIPTOR):
            packed.Unpack(detail)
    return detail


def may_succeed_later(error: grpc.RpcError) -> bool:
    return (error.code() == grpc.StatusCode.UNAVAILABLE
            or _detail(error).reason in _BROKEN_UPLOADS
            or any(packed.type_url.endswith("/google.rpc.RetryInfo")
                   for packed in details(error).details))


def of_call(error: grpc.RpcError, silent_server: str = "") -> LitagsError:
    """`silent_server`: the address that was called, if nothing there has answered so far."""
    detail = _detail(error)
    message = error.details() or ""
    if silent_server and error.code() == grpc.StatusCode.UNAVAILABLE:
        message = (f"no server answers at {silent_server}: start one with \"litags-server\", or name "
                   "another with LITAGS_SERVER; one that speaks TLS needs LITAGS_TLS or "
                   f"LITAGS_TLS_CA, one that does not neither ({message})")
    return LitagsError(error.code(), detail.reason, detail.field, message,
                       may_succeed_later(error))


def left_job(job: str, request_id: str, starting: bool) -> str:
    """How `job` stands whose upload, or start, nobody knows the end of."""
    how = (f"may have been started, see: litags show {job}; if it was not, " if starting
           else "was not started and is still there: ")
    return (f"{job} {how}submit the same again with request_id=\"{request_id}\", or remove it with: "
            f"litags delete {job}")


def of_left_job(error: LitagsError, job: str, request_id: str, starting: bool) -> LitagsError:
    """Of a server that vanished, or stayed busy, before all of `job` was sent, or at its start."""
    return LitagsError(error.code, error.reason, error.field,
                       f"{error.message}; {left_job(job, request_id, starting)}",
                       error.may_succeed_later)


def raise_unless_succeeded(job: job_pb2.Job) -> None:
    if job.state == job_pb2.JOB_STATE_FAILED:
        error = job.error
        raise LitagsError(_CODES[error.code], error.detail.reason, error.detail.field,
                          f"{job.name}: {error.message}")
    if job.state == job_pb2.JOB_STATE_CANCELLED:
        raise LitagsError(grpc.StatusCode.CANCELLED, "CANCELLED", "",
                          f"{job.name} was cancelled")
