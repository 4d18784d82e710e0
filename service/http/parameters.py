"""The query parameters of POST /subdivide."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from ..bodies.media import Kind
from ..options import (
    CREASE_PATTERN,
    DEFAULTS,
    MAX_LEVELS,
    MAX_WELD_TOLERANCE,
    BorderRule,
    Compression,
    Diagnostics,
    NormalRule,
    Options,
    PolygonRule,
    SchemeName,
    UvRule,
    WeldRule,
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


class Parameters(BaseModel):
    """Parameters of a request; another name is an error, since a misspelt one would be lost."""

    model_config = ConfigDict(extra="forbid")

    levels: int = Field(
        default=DEFAULTS.levels,
        ge=1,
        le=MAX_LEVELS,
        description="depth: each level makes four faces of one",
    )
    scheme: SchemeName = Field(
        default=DEFAULTS.scheme,
        description="`auto`: `pns` for files of triangles, `catmull-clark` for OBJ, PLY and OFF "
        "files with polygons; `pns` and `loop` cut polygons into triangles, and `loop` is without "
        "the learned correction",
    )
    model: Annotated[str | None, BeforeValidator(_empty_is_absent)] = Field(
        default=None,
        description="a name from `GET /models`; empty: the service's default. `scheme=loop` has no "
        "use for it or for `budget`: both are checked and then have no effect",
    )
    budget: Annotated[
        Annotated[float, Field(ge=0, allow_inf_nan=False)] | None,
        BeforeValidator(_empty_is_absent),
    ] = Field(default=DEFAULTS.budget, description="C, dimensionless; empty: the model's own")
    reference_length: Annotated[
        Literal["auto"] | Annotated[float, Field(gt=0, allow_inf_nan=False)],
        BeforeValidator(_length),
    ] = Field(
        default=DEFAULTS.reference_length,
        description="R, the unit of length of the budget; `auto` measures each mesh",
    )
    diagnostics: Diagnostics = Field(
        default=DEFAULTS.diagnostics,
        description="`full` adds the vertex attributes `_PNS_RATIO` and `_PNS_GATE` of the last "
        "learned level",
    )
    uv: UvRule = Field(
        default=DEFAULTS.uv,
        description="`smooth`: Loop's stencil inside charts; their boundaries stay linear",
    )
    normals: NormalRule = Field(
        default=DEFAULTS.normals,
        description="`auto`: hard edges of the file stay hard, and a mesh without normals gets "
        "new ones, smooth but across sharp edges; `keep`: a mesh without normals stays without; "
        "`smooth`: new ones everywhere, smooth but across sharp edges; "
        "`limit`: the same, and exactly those of the limit surface (with `limit=true`)",
    )
    crease: str = Field(
        default=DEFAULTS.crease,
        pattern=f"^({CREASE_PATTERN})$",
        description="edges to keep sharp: `auto` (each as sharp as the model's sharpness network "
        "finds it, at as many levels as the card says; none without such a network), `off`, "
        "`normals` (edges whose two sides carry different normals) or `angle:` and degrees (edges "
        "whose faces meet at more)",
    )
    weld: WeldRule = Field(
        default=DEFAULTS.weld,
        description="which vertices are one: `position`, those in one place; `index`, those that "
        "the file gives one number, so that poses of one file keep one numbering; `off`, corners "
        "that are alike in all they have",
    )
    weld_tolerance: float = Field(
        default=DEFAULTS.weld_tolerance,
        ge=0,
        le=MAX_WELD_TOLERANCE,
        allow_inf_nan=False,
        description="join vertices nearer than this times R; 0: exactly equal ones alone",
    )
    border: BorderRule = Field(
        default=DEFAULTS.border,
        description="what boundaries do: `smooth`, they become curves; `corners`, these end at "
        "vertices of one face alone; `fixed`, boundaries stay as they are",
    )
    polygons: PolygonRule = Field(
        default=DEFAULTS.polygons,
        description="`auto`: where most triangles of a glTF are halves of quads, or parts of "
        "polygons by FB_ngon_encoding, these are refined by Catmull-Clark; `off`: triangles are "
        "refined as they are",
    )
    material: Annotated[str | None, BeforeValidator(_empty_is_absent)] = Field(
        default=DEFAULTS.material,
        description="refine only the faces of this material; triangles beside them are cut, and "
        "polygons get more corners",
    )
    group: Annotated[str | None, BeforeValidator(_empty_is_absent)] = Field(
        default=DEFAULTS.group,
        description="refine only this group or object of an OBJ, or mesh of a glTF, by its name or "
        "that of a node that shows it",
    )
    compress: Compression = Field(
        default=DEFAULTS.compress,
        description="`meshopt` is exact; `draco` is smaller, and rounds positions, normals and UVs",
    )
    format: Kind = Field(
        default="glb",
        description="of the answer; `gltf` has its buffers inside, `obj`, `ply`, `stl` and `off` "
        "hold what `pns subdivide` writes there",
    )
    limit: bool = Field(
        default=DEFAULTS.limit,
        description="put the vertices where Loop's rules would take them in the end: on the limit "
        "surface",
    )

    def options(self) -> Options:
        """Return the pipeline's options: all but the model and the format of the answer."""
        return Options(**self.model_dump(exclude={"model", "format"}))
