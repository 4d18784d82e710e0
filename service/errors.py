"""The service's error tree: what may go wrong with a request, and the HTTP status each kind means.

Every error carries data, not a sentence to parse: `code` is a stable slug that a client may branch
on, `detail` says what was found in this request, `pointer` is the JSON pointer of the offending
value in the upload where there is one. An exception outside this tree is our own fault and is never
dressed up as one of these.
"""

from __future__ import annotations

from collections.abc import Sequence

# Of a text and of a pointer, characters. Both may name what an upload calls its parts, and an error
# is kept, and written into answers, by the process that holds no uploads.
LONGEST = 8_000


def shortened(text: str) -> str:
    """Return a text that is not too long."""
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def shortened_pointer(pointer: str) -> str:
    """Return a pointer that is not too long: to what holds the value."""
    return pointer if len(pointer) <= LONGEST else pointer[:LONGEST].rpartition("/")[0]


class ServiceError(Exception):
    """Base of everything that the service answers with a problem document.

    A detail and a pointer that are too long are cut: the pointer to what holds the value.
    """

    status = 500
    code = "service-error"
    title = "The request could not be answered"

    def __init__(self, detail: str, *, pointer: str | None = None, code: str | None = None) -> None:
        detail = shortened(detail)
        super().__init__(detail)
        self.detail = detail
        self.pointer = None if pointer is None else shortened_pointer(pointer)
        if code is not None:
            self.code = code

    def __str__(self) -> str:
        at = "" if self.pointer is None else f" (at {self.pointer})"
        return f"{self.detail}{at}"

    def __reduce__(self) -> tuple[object, ...]:
        # Errors cross from worker processes, and are made from other things than their detail.
        return (_restored, (type(self), dict(self.__dict__)))


class UnreadableError(ServiceError):
    """The bytes are not the format that they claim to be."""

    status = 400
    code = "unreadable"
    title = "The file cannot be read"


class LimitError(ServiceError):
    """A limit was exceeded: body size, predicted faces, predicted memory, JSON size."""

    status = 413
    code = "limit-exceeded"
    title = "The request is over a limit"

    def __init__(self, detail: str, *, limit: str, allowed: float, found: float) -> None:
        super().__init__(detail)
        self.limit = limit
        self.allowed = allowed
        self.found = found


class MediaTypeError(ServiceError):
    """The content type is none that this service takes."""

    status = 415
    code = "unsupported-media-type"
    title = "The content type is not supported"


class UnauthorizedError(ServiceError):
    """There is no key, or it is not one of ours."""

    status = 401
    code = "unauthorized"
    title = "A key is needed"


class GltfError(ServiceError):
    """The file reads, but breaks its own promises: an accessor, an index, a node tree, a NaN."""

    status = 422
    code = "invalid-gltf"
    title = "The glTF breaks its own promises"


class UnsupportedFeature(ServiceError):  # noqa: N818
    """A correct file that uses something which is not refined yet; `feature` names it."""

    status = 422
    code = "unsupported-feature"
    title = "The file uses a feature that is not supported"

    def __init__(self, feature: str, *, pointer: str | None = None) -> None:
        super().__init__(f"{feature} cannot be refined yet", pointer=pointer)
        self.feature = feature


class UnrefinableError(ServiceError):
    """A mesh that cannot be refined: no triangles, or no face left after cleaning."""

    status = 422
    code = "unrefinable-mesh"
    title = "The mesh cannot be refined"


class InvalidParameter(ServiceError):  # noqa: N818
    """A query parameter outside its range; `name` says which, `choices` what it may be."""

    status = 422
    code = "invalid-parameter"
    title = "A parameter is out of range"

    def __init__(self, name: str, detail: str, *, choices: Sequence[str] = ()) -> None:
        super().__init__(detail)
        self.name = name
        self.choices = tuple(choices)


class BusyError(ServiceError):
    """Every worker is taken; `retry_after` is in whole seconds."""

    status = 503
    code = "busy"
    title = "The service is busy"

    def __init__(self, detail: str = "every worker is taken", *, retry_after: int = 1) -> None:
        super().__init__(detail)
        self.retry_after = retry_after


class NoStorageError(ServiceError):
    """There is no room for a body or a result: the disk or the memory is full, or not writable.

    Nothing of what did not fit is kept.
    """

    status = 503
    code = "no-storage"
    title = "There is no room to store this"


class NoModelError(ServiceError):
    """The PNS scheme was asked for and no model is loaded."""

    status = 503
    code = "no-model"
    title = "No model is loaded"


class JobTimeout(ServiceError):  # noqa: N818
    """The job ran longer than a job may."""

    status = 504
    code = "job-timeout"
    title = "The job took too long"


class WorkerDied(BusyError):  # noqa: N818
    """The worker that held this job ended before it answered (memory, a signal)."""

    code = "worker-died"
    title = "The worker process ended unexpectedly"


def check_limit(limit: str, asked: int, allowed: int, text: str) -> None:
    """Raise LimitError where `asked` is more than `allowed`; `text` says what has so much."""
    if asked > allowed:
        raise LimitError(f"{text}, more than {allowed}", limit=limit, allowed=allowed, found=asked)


def check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    """Raise InvalidParameter where the value of the parameter `name` is none of `choices`."""
    if value not in choices:
        text = f"{name} must be one of {', '.join(choices)}"
        raise InvalidParameter(name, text, choices=choices)


def _restored(kind: type[ServiceError], state: dict[str, object]) -> ServiceError:
    """Restore an error that crossed from another process."""
    error = kind.__new__(kind)
    Exception.__init__(error, state["detail"])
    error.__dict__.update(state)
    return error


def printable(text: str) -> str:
    """Return a line as a terminal may show it: a file's name or content may hold its commands."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def quoted(data: bytes | memoryview) -> str:
    """Return a file's first characters, or its first bytes where these are no text."""
    start = bytes(data[:8])
    text = b" ".join(start.split()).decode("latin-1")
    return repr(text) if text.isascii() and text.isprintable() and text else start.hex(" ")
