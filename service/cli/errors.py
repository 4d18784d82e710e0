"""Errors as the command line says them: one line and an exit code."""

from __future__ import annotations

# Exit code for a parameter out of its range, as the command line's own parser uses it.
USAGE_ERROR = 2
# Exit code for a file or a model that cannot be used.
FAILURE = 1

_SETTING_OF_LIMIT = {
    "faces": "PNS_FACES",
    "memory": "PNS_MEMORY",
    "json-items": "PNS_JSON_ITEMS",
}


def explained(error: Exception) -> tuple[str, int] | None:
    """Return the line and the exit code of an error that is not our fault; None for one that is.

    Its notes are the files that it is of.
    """
    known = _explained(error)
    if known is None:
        return None
    line, code = known
    return "".join(f"{note}: " for note in getattr(error, "__notes__", ())) + line, code


def _explained(error: Exception) -> tuple[str, int] | None:
    from pydantic import ValidationError

    from pns_common.errors import ParameterError, PnsError

    from ..errors import InvalidParameter, LimitError, ServiceError
    from ..http.access.keys import KeysError
    from ..http.watch.tracing import TracingError
    from ..settings import PREFIX, StartError

    match error:
        case InvalidParameter() | ParameterError():
            return str(error), USAGE_ERROR
        case ValidationError():
            first = error.errors()[0]
            # Of a list that holds a wrong value, the setting.
            name = str(next(iter(first["loc"]), ""))
            text = first["msg"].removeprefix("Value error, ")
            return f"{PREFIX}{name.upper()}: {text}" if name else text, USAGE_ERROR
        case LimitError(limit=limit) if limit in _SETTING_OF_LIMIT:
            return f"{error}; {_SETTING_OF_LIMIT[limit]} allows more", FAILURE
        case ServiceError() | PnsError() | KeysError() | TracingError() | StartError():
            return str(error), FAILURE
        case OSError():
            return f"{error.filename or 'output'}: {error.strerror or error}", FAILURE
        case _:
            return None
