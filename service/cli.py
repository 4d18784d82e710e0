"""`pns`: refine files, serve, show what a model says of itself, write an example.

Commands import what they need when they run, so that `pns --help` answers at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Proximity-Preserving Neural Subdivision of glTF, OBJ, PLY, STL and OFF files.",
)

USAGE_ERROR = 2
"""Exit code for a parameter out of its range, as the command line's own parser uses it."""
FAILURE = 1
"""Exit code for a file or a model that cannot be used."""

_SETTING_OF_LIMIT = {
    "faces": "PNS_FACES",
    "memory": "PNS_MEMORY",
    "json-items": "PNS_JSON_ITEMS",
}


def main() -> None:
    """Run the command line; an error that a user can act on is one line, any other a traceback."""
    try:
        app()
    except Exception as error:
        known = _explained(error)
        if known is None:
            raise
        message, code = known
        typer.echo(f"pns: {' '.join(message.split())}", err=True)
        raise SystemExit(code) from error


@app.command()
def subdivide(
    source: Annotated[Path, typer.Argument(metavar="IN", help="glb, gltf, obj, ply, stl or off")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="file to write")],
    levels: Annotated[int, typer.Option(help="depth: four faces of one at each level")] = 1,
    scheme: Annotated[Literal["pns", "loop"], typer.Option(help="the rules")] = "pns",
    budget: Annotated[
        float | None, typer.Option(metavar="C", help="default: the model's own")
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="a bundled model (see pns info), else a model file; ./NAME is always a file. "
            "Default: the default model",
        ),
    ] = None,
    reference_length: Annotated[
        str, typer.Option(metavar="auto|X", help="unit of length of the budget")
    ] = "auto",
    diagnostics: Annotated[
        Literal["summary", "full", "none"], typer.Option(help="what a glTF carries of the report")
    ] = "summary",
    uv: Annotated[
        Literal["linear", "smooth"], typer.Option(help="smooth: Loop's stencil inside charts")
    ] = "linear",
    crease: Annotated[
        str, typer.Option(metavar="off|normals|angle:DEG", help="edges to keep sharp")
    ] = "off",
    weld_tolerance: Annotated[
        float, typer.Option(metavar="X", help="join vertices nearer than X times R")
    ] = 0.0,
    compress: Annotated[
        Literal["none", "draco", "meshopt"], typer.Option(help="how a glTF's geometry is written")
    ] = "none",
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="write the report too")
    ] = None,
) -> None:
    """Refine IN and write OUT; the formats go by the files' extensions."""
    from service.convert import convert
    from service.options import Options
    from service.settings import Settings

    options = Options(
        levels=levels,
        scheme=scheme,
        budget=budget,
        reference_length=_reference_length(reference_length),
        diagnostics=diagnostics,
        uv=uv,
        crease=crease,
        weld_tolerance=weld_tolerance,
        compress=compress,
    )
    convert(source, output, options, model, report, Settings().job_limits())


@app.command()
def serve(
    host: Annotated[str | None, typer.Option(help="default: PNS_HOST, else 127.0.0.1")] = None,
    port: Annotated[int | None, typer.Option(help="default: PNS_PORT, else 8000")] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="the model of requests that name none. Default: PNS_MODEL, else the default model",
        ),
    ] = None,
) -> None:
    """Serve HTTP; every other setting is an environment variable PNS_…."""
    from service.server import serve as run
    from service.settings import Settings

    given = {"host": host, "port": port, "model": model}
    run(Settings(**{name: value for name, value in given.items() if value is not None}))


@app.command()
def info(
    model: Annotated[
        str | None,
        typer.Argument(metavar="NAME|FILE", help="a bundled model, else a model file"),
    ] = None,
) -> None:
    """List the bundled models; with a name or a file, show what that model says of itself."""
    from pns_common.onnx_model import bundled_models, load_model
    from service.model_info import print_model, print_models

    if model is None:
        print_models(load_model(name) for name in bundled_models())
    else:
        print_model(load_model(model))


@app.command()
def example(
    output: Annotated[Path, typer.Argument(metavar="OUT.glb", help="file to write")],
) -> None:
    """Write a small mechanical part with ridges, fillets and UVs, to try the other commands on."""
    from service.errors import InvalidParameter
    from service.example import part_glb
    from service.files import replace_file

    if output.suffix.lower() != ".glb":
        raise InvalidParameter("output", f"{output}: the example is a .glb file")
    replace_file(output, part_glb())


def _reference_length(text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError as error:
        hint = "--reference-length"
        raise typer.BadParameter("it must be 'auto' or a number", param_hint=hint) from error


def _explained(error: Exception) -> tuple[str, int] | None:
    """The line and the exit code of an error that is not our fault; None for one that is."""
    from pydantic import ValidationError

    from pns_common.errors import ParameterError, PnsError
    from service.errors import InvalidParameter, LimitError, ServiceError

    match error:
        case InvalidParameter() | ParameterError():
            return str(error), USAGE_ERROR
        case ValidationError():
            first = error.errors()[0]
            name = ".".join(str(part) for part in first["loc"])
            return f"setting {name}: {first['msg']}", USAGE_ERROR
        case LimitError(limit=limit) if limit in _SETTING_OF_LIMIT:
            return f"{error}; {_SETTING_OF_LIMIT[limit]} allows more", FAILURE
        case ServiceError() | PnsError():
            return str(error), FAILURE
        case OSError():
            return f"{error.filename or 'output'}: {error.strerror}", FAILURE
        case _:
            return None
