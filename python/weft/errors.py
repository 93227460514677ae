"""What goes wrong, with the words and the exit codes of the command line."""

import grpc


class WeftError(Exception):
    """The one family of exceptions: says first what was wrong, then how to mend it.

    `code` is the name that gRPC gives such errors, `exit_code` what the command line ends with.
    """

    code = "INTERNAL"
    exit_code = 1


class InvalidArgument(WeftError):
    code = "INVALID_ARGUMENT"


class NotFound(WeftError):
    code = "NOT_FOUND"
    exit_code = 3


class AlreadyExists(WeftError):
    code = "ALREADY_EXISTS"


class FailedPrecondition(WeftError):
    code = "FAILED_PRECONDITION"


class PermissionDenied(WeftError):
    code = "PERMISSION_DENIED"
    exit_code = 4


class ResourceExhausted(WeftError):
    code = "RESOURCE_EXHAUSTED"
    exit_code = 4


class Unavailable(WeftError):
    code = "UNAVAILABLE"
    exit_code = 5


class DataLoss(WeftError):
    code = "DATA_LOSS"


class Cancelled(WeftError):
    code = "CANCELLED"


class JobFailed(WeftError):
    """A job ended without a version; `job` says how."""

    code = "FAILED_PRECONDITION"

    def __init__(self, message, job):
        super().__init__(message)
        self.job = job


_KINDS = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidArgument,
    grpc.StatusCode.OUT_OF_RANGE: InvalidArgument,
    grpc.StatusCode.NOT_FOUND: NotFound,
    grpc.StatusCode.ALREADY_EXISTS: AlreadyExists,
    grpc.StatusCode.FAILED_PRECONDITION: FailedPrecondition,
    grpc.StatusCode.ABORTED: FailedPrecondition,
    grpc.StatusCode.PERMISSION_DENIED: PermissionDenied,
    grpc.StatusCode.UNAUTHENTICATED: PermissionDenied,
    grpc.StatusCode.RESOURCE_EXHAUSTED: ResourceExhausted,
    grpc.StatusCode.UNAVAILABLE: Unavailable,
    grpc.StatusCode.DEADLINE_EXCEEDED: Unavailable,
    grpc.StatusCode.DATA_LOSS: DataLoss,
    grpc.StatusCode.CANCELLED: Cancelled,
}

_BY_EXIT_CODE = {2: InvalidArgument, 3: NotFound, 4: PermissionDenied, 5: Unavailable}


def from_status(status, message):
    """The exception for a gRPC status code."""
    return _KINDS.get(status, WeftError)(message)


def from_exit_code(exit_code, message):
    """The exception for what a program of weft ended with."""
    return _BY_EXIT_CODE.get(exit_code, FailedPrecondition)(message)
