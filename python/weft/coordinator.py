"""A cluster's coordinator: queue jobs, watch them, look at what is published, fetch it."""

import hashlib
import json
import os
import time
import uuid

import grpc

from . import errors, programs, schema
from .channel import DEFAULT_COORDINATOR, Connection
from .database import Database

_CALL_SECONDS = 20
_STREAM_SECONDS = 60  # a stream is renewed this often, so that one that hangs is noticed
_AWAY_SECONDS = 60
_TRIES = 3
_USER_BLOCK_BYTES = 512
_AWAY = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.DEADLINE_EXCEEDED)
_FOREIGN = (grpc.StatusCode.UNIMPLEMENTED, grpc.StatusCode.UNKNOWN)


def has_ended(job):
    return job.state in (schema.JOB_STATE_SUCCEEDED, schema.JOB_STATE_FAILED,
                         schema.JOB_STATE_CANCELLED)


def reference_of(version):
    """'silk@3'."""
    return f"{version.fabric}@{version.number}"


def fraction_done(job):
    """How much of a job is done, from 0 to 1: stages count alike."""
    stages = job.stages
    return sum(stage.fraction_done for stage in stages) / len(stages) if stages else 0.0


class Coordinator(Connection):
    """A connection to the coordinator at `address` (default: WEFT_COORDINATOR, else this machine's).

    `tls_folder` is what 'weft certs issue' wrote (default: WEFT_TLS_FOLDER). Methods return messages
    of proto/weft/v1/cluster.proto and raise what weft.errors holds. Any thread may call.
    """

    def __init__(self, address=None, tls_folder=None, insecure=False):
        super().__init__(address or os.environ.get("WEFT_COORDINATOR") or DEFAULT_COORDINATOR,
                         tls_folder, insecure)
        self._jobs = schema.stub(self._channel, "JobService")
        self._workers = schema.stub(self._channel, "WorkersService")
        self._catalogue = schema.stub(self._channel, "CatalogueService")

    # ------------------------------------------------------------------ jobs

    def submit(self, description, quality=None, comment="", user="", priority=0, audit=0.0, labels=()):
        """Queues the precomputation of a fabric and returns the job.

        `description` is the path of a .textproto or .json file (read by the program `weft`, which
        inlines the files it names and fills in defaults), a dict like such JSON, or a
        FabricDescription that `expand` made.
        """
        if not isinstance(description, schema.FabricDescription):
            description = expand(description, quality)
        elif quality is not None:
            raise errors.InvalidArgument("quality belongs to expand() when its result is submitted")
        request = schema.SubmitRequest(request_id=uuid.uuid4().hex, description=description)
        request.options.comment = comment
        request.options.user = user or os.environ.get("WEFT_USER", "")
        request.options.priority = priority
        request.options.audit = audit
        request.options.labels.extend(labels)
        return self._call(self._jobs.Submit, request, f"submit {description.name}", _TRIES).job

    def job(self, job_id):
        return self._call(self._jobs.GetJob, schema.GetJobRequest(job_id=job_id),
                          f"look up job {job_id}").job

    def jobs(self, unfinished_only=False, limit=0):
        request = schema.ListJobsRequest(unfinished_only=unfinished_only, limit=limit)
        return list(self._call(self._jobs.ListJobs, request, "list the jobs").jobs)

    def watch(self, job_id):
        """Yields the job whenever it changes, until it has ended; goes on over a restart."""
        job, away_since = None, None
        while job is None or not has_ended(job):
            try:
                for answer in self._jobs.WatchJob(schema.WatchJobRequest(job_id=job_id),
                                                  timeout=_STREAM_SECONDS):
                    job, away_since = answer.job, None
                    yield job
                    if has_ended(job):
                        return
            except grpc.RpcError as error:
                if error.code() == grpc.StatusCode.DEADLINE_EXCEEDED:
                    continue
                now = time.monotonic()
                away_since = away_since or now
                if (job is None or error.code() != grpc.StatusCode.UNAVAILABLE or
                        now - away_since > _AWAY_SECONDS):
                    raise self._explained(error, f"watch {job_id}") from None
            time.sleep(1)

    def wait(self, job_id, report=None):
        """Returns the job when it has succeeded; raises JobFailed when it ended otherwise.

        `report`, when given, is called with the job whenever it changes.
        """
        for job in self.watch(job_id):
            if report is not None:
                report(job)
        if job.state != schema.JOB_STATE_SUCCEEDED:
            state = schema.word("JobState", job.state)
            raise errors.JobFailed(f"job {job.id} {'was ' if state == 'cancelled' else ''}{state}"
                                   + (f": {job.error}" if job.error else ""), job)
        return job

    def cancel(self, job_id):
        request = schema.CancelJobRequest(request_id=uuid.uuid4().hex, job_id=job_id)
        return self._call(self._jobs.CancelJob, request, f"cancel {job_id}", _TRIES).job

    def workers(self):
        return list(self._call(self._workers.ListWorkers, schema.ListWorkersRequest(),
                               "list the workers").workers)

    # ------------------------------------------------------------- catalogue

    def fabrics(self):
        return list(self._call(self._catalogue.ListFabrics, schema.ListFabricsRequest(),
                               "list the fabrics").fabrics)

    def versions(self, fabric):
        return list(self._call(self._catalogue.ListVersions,
                               schema.ListVersionsRequest(fabric=fabric),
                               f"list the versions of {fabric}").versions)

    def version(self, reference):
        """What silk, silk@3, silk@latest or silk:approved means now."""
        return self._call(self._catalogue.GetVersion,
                          schema.GetVersionRequest(reference=reference),
                          f"look up {reference}").version

    def fetch(self, reference, path):
        """Fetches a published version into `path`, checks it, and opens it as a Database.

        A file there that is this very version is kept, and a fetch that was broken off goes on.
        """
        version = self.version(reference)
        digest = version.content_digest.hex()
        if not (os.path.isfile(path) and _digest_of(path) == digest):
            part = f"{path}.{digest}.part"
            self._fetch_rest(version, part)
            found = _digest_of(part)
            if found != digest:
                os.remove(part)
                raise errors.DataLoss(f"{reference_of(version)} came with other bytes than were "
                                      f"published ({found[:12]}, not {digest[:12]}); fetch it again")
            os.replace(part, path)
        return Database(path)

    def _fetch_rest(self, version, part):
        away_since = None
        while (have := os.path.getsize(part) if os.path.exists(part) else 0) < version.size_bytes:
            request = schema.FetchVersionRequest(reference=reference_of(version), offset=have)
            try:
                with open(part, "ab") as file:
                    for answer in self._catalogue.FetchVersion(request, timeout=3600):
                        file.write(answer.data)
                        away_since = None
            except grpc.RpcError as error:
                now = time.monotonic()
                away_since = away_since or now
                if error.code() not in _AWAY or now - away_since > _AWAY_SECONDS:
                    raise self._explained(error, f"fetch {reference_of(version)}") from None
                time.sleep(1)

    # ----------------------------------------------------------------- calls

    def _call(self, method, request, doing, tries=1):
        for tries_left in range(tries, 0, -1):
            try:
                return method(request, timeout=_CALL_SECONDS)
            except grpc.RpcError as error:
                if tries_left == 1 or error.code() not in _AWAY:
                    raise self._explained(error, doing) from None
            time.sleep(0.3)

    def _explained(self, error, doing):
        code, details, address = error.code(), error.details(), self._endpoint.address
        if code == grpc.StatusCode.UNAVAILABLE:
            problem = self._endpoint.tls_problem()
            if problem:
                return errors.PermissionDenied(f"cannot {doing}: {problem}")
        if code in _AWAY:
            return errors.Unavailable(
                f"cannot {doing}: no coordinator answers at {address} ({details}); start one with "
                "'weft up', or name another with --coordinator or WEFT_COORDINATOR")
        if code in _FOREIGN:
            return errors.Unavailable(
                f"cannot {doing}: what answers at {address} is not a coordinator of this weft "
                f"({details}); name another with --coordinator")
        return errors.from_status(code, details)


def expand(description, quality=None):
    """A description with every file inlined and every default filled in, by the program `weft`.

    `description`: the path of a .textproto or .json file, or a dict like such JSON. Raises
    InvalidArgument with every mistake and its place.
    """
    arguments = ["--quality", quality] if quality else []
    if isinstance(description, dict):
        text = programs.run("weft", "expand", "-", *arguments, given=json.dumps(description))
    else:
        text = programs.run("weft", "expand", os.fspath(description), *arguments)
    return schema.parse_json(text, schema.FabricDescription())


def _digest_of(path):
    """SHA-256 of a database's contents: of all that follows its user block."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        file.seek(_USER_BLOCK_BYTES)
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()
