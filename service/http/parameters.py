"""The query parameters of POST /subdivide."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Annotated, Any, Literal, get_args, get_type_hints

from pydantic import BeforeValidator, ConfigDict, Field, create_model
from pydantic_core import PydanticCustomError

from ..bodies.media import Kind
from ..options import DESCRIPTIONS, Options

_EMPTY_IS_NONE = BeforeValidator(lambda value: None if value == "" else value)


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


def _type_of(name: str, hint: Any, bounds: dict[str, Any]) -> Any:
    """Return a parameter's type with its bounds; `budget=` in a URL is none."""
    if name == "reference_length":
        positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
        return Annotated[Literal["auto"] | positive, BeforeValidator(_length)]
    kinds = get_args(hint)
    if type(None) not in kinds:
        return Annotated[hint, Field(**bounds)]
    return Annotated[Annotated[kinds[0], Field(**bounds)] | None, _EMPTY_IS_NONE]


_HINTS = get_type_hints(Options)
_SHARED: dict[str, Any] = {
    option.name: (
        _type_of(option.name, _HINTS[option.name], option.metadata["bounds"]),
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
