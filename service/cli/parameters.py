"""The parameters that commands share, and the `Options` that they give."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from ..options import (
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


def options_of(context: typer.Context) -> Options:
    """Return what a command was given of the parameters that every way of refining shares.

    Raises:
        InvalidParameter: one is out of its range.
    """
    names = {field.name for field in fields(Options)}
    return Options(**{name: value for name, value in context.params.items() if name in names})


def local_path(text: str) -> Path:
    """Return the path of a file of this machine; a URL is none."""
    if "://" in text:
        raise typer.BadParameter(f"{text} is a URL: save the file first, or use pns batch")
    return Path(text)


def _reference_length(text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError as error:
        raise typer.BadParameter("it must be 'auto' or a number") from error


LevelsOption = Annotated[
    int, typer.Option(help=f"depth, 1 to {MAX_LEVELS}: four faces of one at each level")
]
SchemeOption = Annotated[
    SchemeName,
    typer.Option(help="the rules; auto: pns for triangles, catmull-clark for polygons"),
]
BudgetOption = Annotated[float | None, typer.Option(metavar="C", help="default: the model's own")]
ModelOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="a bundled model (see pns info), else a model file; ./NAME is always a file. "
        "Default: the default model",
    ),
]
LengthOption = Annotated[
    # What the parser returns: typer takes no union of two types.
    Any,
    typer.Option(metavar="auto|X", parser=_reference_length, help="unit of length of the budget"),
]
DiagnosticsOption = Annotated[Diagnostics, typer.Option(help="what a glTF carries of the report")]
UvOption = Annotated[UvRule, typer.Option(help="smooth: Loop's stencil inside charts")]
NormalsOption = Annotated[
    NormalRule,
    typer.Option(
        help="auto: those of the file; where a mesh has none, smooth but across sharp edges. "
        "keep: none where there are none. smooth: new ones for every mesh. limit: those of the "
        "limit surface, with --limit"
    ),
]
CreaseOption = Annotated[
    str,
    typer.Option(
        metavar="auto|off|normals|angle:DEG",
        help="edges to keep sharp; auto: each as sharp as the model finds it, "
        "at two levels; normals: those that a glTF's normals make hard",
    ),
]
WeldOption = Annotated[
    WeldRule,
    typer.Option(
        help="which vertices are one. position: those in one place. index: those that the file "
        "gives one number, so that poses keep one numbering. off: corners alike in all they have"
    ),
]
BorderOption = Annotated[
    BorderRule,
    typer.Option(
        help="boundaries. smooth: curves. corners: curves that end at vertices of one face. "
        "fixed: as they are"
    ),
]
PolygonsOption = Annotated[
    PolygonRule,
    typer.Option(
        help="triangles of a glTF. auto: joined to the quads that most of them are halves of, for "
        "Catmull-Clark. off: refined as they are"
    ),
]
MaterialOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="refine only the faces of this material")
]
GroupOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="refine only this group or object (OBJ), or mesh (glTF)"),
]
ToleranceOption = Annotated[
    float,
    typer.Option(
        metavar="X", help=f"0 to {MAX_WELD_TOLERANCE}: join vertices nearer than X times R"
    ),
]
CompressOption = Annotated[Compression, typer.Option(help="how a glTF's geometry is written")]
EngineOption = Annotated[
    Literal["local", "ray"], typer.Option(help="processes of this machine, or a Ray cluster")
]
AddressOption = Annotated[
    str | None,
    typer.Option(help="a Ray cluster, or auto; implies --engine ray. Default: one started here"),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="workers at a time; default: one for each processor")
]
LimitOption = Annotated[bool, typer.Option("--limit", help="put the vertices on the limit surface")]
