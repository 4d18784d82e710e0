"""The error tree of the operator: every error carries its data, and its text is made from them."""

from __future__ import annotations

from typing import Any


class PnsError(Exception):
    """Base of everything that the operator raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Exceptions are made again from their text, which is not what these are made from.
        return _restored, (type(self), self.args, self.__dict__)


class MeshError(PnsError):
    """A mesh that cannot be refined. ``element`` ("vertex", "face", …) and ``index`` say where."""

    def __init__(self, reason: str, *, element: str | None = None, index: int | None = None):
        self.reason = reason
        self.element = element
        self.index = index
        where = "" if element is None else element if index is None else f"{element} {index}"
        super().__init__(f"{where}: {reason}" if where else reason)


class ModelError(PnsError):
    """A model file that breaks the contract: what was expected and what was found."""

    def __init__(self, path: str, *, expected: str, found: str):
        self.path = path
        self.expected = expected
        self.found = found
        super().__init__(f"model {path}: expected {expected}, found {found}")


class ParameterError(PnsError, ValueError):
    """An argument outside its range, with its name, its value and the range."""

    def __init__(self, name: str, value: object, *, expected: str):
        self.name = name
        self.value = value
        self.expected = expected
        super().__init__(f"{name} = {value!r}: expected {expected}")


def _restored(kind: type[PnsError], args: tuple[Any, ...], values: dict[str, Any]) -> PnsError:
    """Restore an error that crossed from another process."""
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(values)
    return error
