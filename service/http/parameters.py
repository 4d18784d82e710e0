"""The query parameters of POST /subdivide."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Annotated, Any, Literal, get_type_hints

from pydantic import BeforeValidator, ConfigDict, Field, create_model
from pydantic_core import PydanticCustomError

from ..bodies.media import Kind
from ..options import (
    CREASE_PATTERN,
    DESCRIPTIONS,
    LENGTH_PATTERN,
    MAX_LEVELS,
    MAX_WELD_TOLERANCE,
    Options,
)

_EMPTY_IS_NONE = BeforeValidator(lambda value: None if value == "" else value)


def _optional(kind: Any, **bounds: Any) -> Any:
    """Return the type of a parameter that may be absent, as `budget=` in a URL is."""
    bounded = Annotated[kind, Field(**bounds)]
    return Annotated[bounded | None, _EMPTY_IS_NONE]


def _length(value: Any) -> float | Literal["auto"]:
    """Refuse with one sentence what is neither; a union would explain only one of the two."""
    if value == "auto":
        return "auto"
    try:
        length = float(value)
    except (TypeError, ValueError):
        length = math.nan
    if not (math.isfinite(length) and length > 0):
        raise PydanticCustomError("reference_length", "it must be 'auto' or a finite number > 0")
    return length


_NAME = _optional(str)
_LENGTH = _optional(str, pattern=f"^{LENGTH_PATTERN}$")
# Where a type of `Options` does not say all that it refuses.
_TYPES = get_type_hints(Options) | {
    "levels": Annotated[int, Field(ge=1, le=MAX_LEVELS)],
    "budget": _optional(float, ge=0, allow_inf_nan=False),
    "reference_length": Annotated[
        Literal["auto"] | Annotated[float, Field(gt=0, allow_inf_nan=False)],
        BeforeValidator(_length),
    ],
    "crease": Annotated[str, Field(pattern=f"^({CREASE_PATTERN})$")],
    "weld_tolerance": Annotated[float, Field(ge=0, le=MAX_WELD_TOLERANCE, allow_inf_nan=False)],
    "material": _NAME,
    "tolerance": _LENGTH,
    "angle": _optional(float, gt=0, lt=180),
    "max_faces": _optional(int, ge=1),
    "max_edge_length": _LENGTH,
    "group": _NAME,
}
_SHARED: dict[str, Any] = {
    option.name: (
        _TYPES[option.name],
        Field(default=option.default, description=DESCRIPTIONS[option.name]),
    )
    for option in fields(Options)
}


class Parameters(create_model("Shared", **_SHARED)):
    """Parameters of a request; another name is an error, since a misspelt one would be lost."""

    model_config = ConfigDict(extra="forbid")

    model: Annotated[str | None, _EMPTY_IS_NONE] = Field(
        default=None,
        description="a name from `GET /models`; empty: the service's default. `scheme=loop` has no "
        "use for it or for `budget`: both are checked and then have no effect",
    )
    format: Kind = Field(
        default="glb",
        description="of the answer; `gltf` has its buffers inside, `obj`, `ply`, `stl` and `off` "
        "hold what `pns subdivide` writes there",
    )

    def options(self) -> Options:
        """Return the pipeline's options: all but the model and the format of the answer."""
        return Options(**self.model_dump(exclude={"model", "format"}))
