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


def _empty_is_absent(value: Any) -> Any:
    """Take `budget=` in a URL for no budget at all."""
    return None if value == "" else value


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


_Name = Annotated[str | None, BeforeValidator(_empty_is_absent)]
_Length = Annotated[
    Annotated[str, Field(pattern=f"^{LENGTH_PATTERN}$")] | None, BeforeValidator(_empty_is_absent)
]
# Where a type of `Options` does not say all that it refuses.
_TYPES = get_type_hints(Options) | {
    "levels": Annotated[int, Field(ge=1, le=MAX_LEVELS)],
    "budget": Annotated[
        Annotated[float, Field(ge=0, allow_inf_nan=False)] | None,
        BeforeValidator(_empty_is_absent),
    ],
    "reference_length": Annotated[
        Literal["auto"] | Annotated[float, Field(gt=0, allow_inf_nan=False)],
        BeforeValidator(_length),
    ],
    "crease": Annotated[str, Field(pattern=f"^({CREASE_PATTERN})$")],
    "weld_tolerance": Annotated[float, Field(ge=0, le=MAX_WELD_TOLERANCE, allow_inf_nan=False)],
    "material": _Name,
    "tolerance": _Length,
    "max_faces": Annotated[Annotated[int, Field(ge=1)] | None, BeforeValidator(_empty_is_absent)],
    "max_edge_length": _Length,
    "group": _Name,
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

    model: _Name = Field(
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
