"""How a kernel is declared and called: plain functions until they are asked for.

Nothing here loads a compiler. A kernel's machine code is read from where it is kept, or made once
(library.py). A plain function in these modules is a helper: it becomes part of the kernels that
call it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

# Of an array's flags, asked together: it is in C's order and aligned; and may be written.
READ = 0x0001 | 0x0100
WRITTEN = READ | 0x0400


@dataclass(frozen=True)
class Array:
    """An array in C's order.

    Attributes:
        written: by the kernel.
        natural: int32 of which none is negative. Machine code then need not ask of an index whether
            it counts from the end, as one below 0 does: a fifth of what gathers rows.
    """

    dtype: str
    ndim: int
    written: bool = False
    natural: bool = False

    @cached_property
    def checked(self) -> Callable[[np.ndarray], np.ndarray]:
        """What returns a value as it is; it raises TypeError where a kernel would read it wrongly.

        It is asked thousands of times a refinement, so it knows all that it compares with.
        """
        dtype, ndim, needed = np.dtype(self.dtype), self.ndim, WRITTEN if self.written else READ

        def checked(value: np.ndarray) -> np.ndarray:
            same = value.dtype is dtype or value.dtype == dtype
            if not same or value.ndim != ndim or value.flags.num & needed != needed:
                kind = f"{value.dtype}, {value.ndim} dimensions"
                raise TypeError(f"a kernel takes {self}, not {kind}, {value.flags}")
            return value

        return checked


POINTS, POINTS_OUT = Array("float64", 2), Array("float64", 2, written=True)
NUMBERS, NUMBERS_OUT = Array("float64", 1), Array("float64", 1, written=True)
INDICES, INDICES_OUT = Array("int32", 2, natural=True), Array("int32", 2, written=True)
INDEX, INDEX_OUT = Array("int32", 1, natural=True), Array("int32", 1, written=True)
# Of which some may be negative, or are counted with.
INTEGERS, INTEGERS_2 = Array("int32", 1), Array("int32", 2)
LONG_INDICES, LONG_INDICES_OUT = Array("int64", 2), Array("int64", 2, written=True)
LONG_INDEX = Array("int64", 1)
CLASSES, CLASSES_OUT = Array("int8", 1), Array("int8", 1, written=True)
SINGLES = Array("float32", 1)
SINGLES_OUT, SINGLES_2_OUT = (Array("float32", n, written=True) for n in (1, 2))
FLAGS, FLAGS_OUT = Array("bool", 1), Array("bool", 1, written=True)

# Stands for the two arguments ``begin`` and ``end`` of a kernel that is called for many blocks.
ROWS = slice(None)

# The mark of helpers that do not become part of a loop.
SELDOM = "called_seldom"

Scalar = Literal["int64", "float64"]
SIZE: Scalar = "int64"
REAL: Scalar = "float64"
_NUMBERS: dict[str, tuple[type, type]] = {
    SIZE: (int, ctypes.c_int64),
    REAL: (float, ctypes.c_double),
}


class Kernel:
    """A function of arrays and numbers whose machine code runs without the GIL.

    Attributes:
        function: what is compiled, for arguments of these types.
        name: of its code in the library.
        by_rows: statements that do the same to the numbers of a row become vectors.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        result: Scalar,
        arguments: tuple[Array | Scalar, ...],
        *,
        by_rows: bool,
    ) -> None:
        self.function, self.result, self.arguments = function, result, arguments
        self.by_rows = by_rows
        self.name = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"
        self.__doc__ = function.__doc__
        self._take = [
            each.checked if isinstance(each, Array) else _NUMBERS[each][0] for each in arguments
        ]

    def __call__(self, *values: Any) -> Any:
        """Run it. Raises TypeError where an argument is of another type."""
        return self.code(*[take(value) for take, value in zip(self._take, values, strict=True)])

    def over(self, *values: Any) -> Callable[..., Any]:
        """Return it as a function of a block's rows, for which ROWS stands among its arguments.

        These are checked once, not for every block; what comes after them is given with the rows.
        Raises TypeError where one is of another type, or ROWS is not among them.
        """
        at = next((i for i, value in enumerate(values) if value is ROWS), None)
        if at is None:
            raise TypeError(f"{self.name}.over takes ROWS in the place of begin and end")
        before, after = self._take[:at], self._take[at + 2 : len(values) + 1]
        first = [take(value) for take, value in zip(before, values[:at], strict=True)]
        then = [take(value) for take, value in zip(after, values[at + 1 :], strict=True)]
        left = self._take[len(values) + 1 :]

        def run(rows: slice, *more: Any) -> Any:
            last = [take(value) for take, value in zip(left, more, strict=True)]
            return self.code(*first, rows.start, rows.stop, *then, *last)

        return run

    @cached_property
    def code(self) -> Callable[..., Any]:
        """Its machine code; loads the library."""
        from pns_common.fused.library import library

        types = [
            ctypes.py_object if isinstance(each, Array) else _NUMBERS[each][1]
            for each in self.arguments
        ]
        prototype = ctypes.CFUNCTYPE(_NUMBERS[self.result][1], *types)
        return prototype(library()[self.name])


def called_seldom(helper: Callable[..., Any]) -> Callable[..., Any]:
    """Declare a helper that is kept out of the loop of the kernel that calls it."""
    setattr(helper, SELDOM, True)
    return helper


def natural(number: Any) -> Any:
    """Return a number that is not negative, so that a compiler knows it is not.

    Machine code then need not ask of rows that are counted from there whether they count from the
    end: a tenth to a third of all that it does.
    """
    return max(number, 0)


def kernel(
    result: Scalar, *arguments: Array | Scalar, by_rows: bool = False
) -> Callable[[Callable[..., Any]], Kernel]:
    """Declare a kernel.

    No fast-math: nothing is reordered or contracted, so a kernel has the bits of the same formula
    in numpy, on any machine. ``by_rows`` is for those that add and divide rows of numbers: they
    take a tenth to a fifth less; what runs on vectors by its loops may take several times as long.
    """
    return lambda function: Kernel(function, result, arguments, by_rows=by_rows)
