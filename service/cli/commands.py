"""`pns`: refine files, serve, show what a model says of itself, write an example.

Commands import what they need when they run, so that `pns --help` answers at once. What a command
declares and does not read itself, `options_of` takes from the context.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import printable
from .errors import FAILURE, explained
from .parameters import (
    AddressOption,
    EngineOption,
    ModelOption,
    WorkersOption,
    job_limits,
    local_path,
    options_of,
    takes_options,
)
from .stops import check_posix

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Proximity-Preserving Neural Subdivision of glTF, OBJ, PLY, STL, OFF and 3MF files.",
)


def main() -> None:
    """Run the command line; an error that a user can act on is one line, any other a traceback."""
    try:
        app()
    except Exception as error:
        if explained(error) is None:
            raise
        raise SystemExit(_tell(error)) from error


def _tell(error: Exception) -> int:
    """Print an error that a user can act on; return its exit code."""
    message, code = explained(error) or (str(error), FAILURE)
    typer.echo(f"pns: {printable(' '.join(message.split()))}", err=True)
    return code


def _version(asked: bool) -> None:
    if asked:
        from pns_common.version import VERSION

        typer.echo(f"pns {VERSION}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="show the version")
    ] = False,
) -> None:
    """Take the options that come before a command."""


@app.command()
@takes_options
def subdivide(
    context: typer.Context,
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="IN...",
            parser=local_path,
            help="glb, gltf, vrm, obj, ply, stl or off; - is stdin",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT",
            parser=local_path,
            help="file to write, or a folder for files called as they are; - is stdout",
        ),
    ],
    model: ModelOption = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", parser=local_path, help="write the report of one IN too"),
    ] = None,
    map_: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="FILE.npz",
            parser=local_path,
            help="write what each vertex of OUT is made of: weights of the vertices of IN, a row "
            "each, as scipy.sparse.load_npz reads them; of a glTF for each primitive",
        ),
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(metavar="FORMAT", help="format of the results; default: as OUT ends"),
    ] = None,
    read_as: Annotated[
        str | None, typer.Option("--from", metavar="FORMAT", help="format of stdin; default: glTF")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="let a result replace its input")] = False,
    **_: Any,
) -> None:
    """Refine each IN; formats go by the files' endings."""
    from ..meshfiles.convert import Jobs, convert

    jobs = Jobs(sources, output, report, map_, to, read_as, force)
    failed = 0
    for error in convert(jobs, options_of(context), model, job_limits()):
        if len(sources) == 1 or explained(error) is None:
            raise error
        failed = failed or _tell(error)
    if failed:
        raise typer.Exit(failed)


@app.command()
@takes_options
def batch(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(help="folder, glob or file; path or URL"),
    ],
    dest: Annotated[str, typer.Argument(help="folder for the results; path or URL")],
    model: ModelOption = None,
    to: Annotated[
        str | None, typer.Option(metavar="FORMAT", help="format of the results; default: as read")
    ] = None,
    engine: EngineOption = "local",
    address: AddressOption = None,
    workers: WorkersOption = None,
    report: Annotated[Path, typer.Option(metavar="FILE", help="rows of all files: .jsonl")] = Path(
        "pns-batch.jsonl"
    ),
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="say what would be done; write no result")
    ] = False,
    **_: Any,
) -> None:
    """Refine a library of files; what was done is not done again when it runs again."""
    check_posix("batch")
    from rich.console import Console

    from ..scale.batch import Batch, batch_work, run_batch
    from ..scale.console import print_summary
    from ..scale.engines.local import local
    from ..scale.engines.on_ray import on_ray
    from ..settings import Settings
    from .stops import stoppable

    settings = Settings()
    chosen = Batch(
        source,
        dest,
        options_of(context),
        settings.job_limits(),
        report,
        to,
        model,
        dry_run,
    )
    work = batch_work(settings.job_seconds)
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    if engine == "ray" or address is not None:
        where = on_ray(work, address, workers, console.print)
    else:
        where = local(work, workers or os.cpu_count() or 1)
    with stoppable(console):
        summary = run_batch(chosen, where, console)
    print_summary(summary, console)
    if summary.failed:
        raise typer.Exit(FAILURE)


@app.command()
def serve(
    host: Annotated[str | None, typer.Option(help="default: PNS_HOST, else 127.0.0.1")] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="default: PNS_PORT, else 8000")
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="the model of requests that name none. Default: PNS_MODEL, else the default model",
        ),
    ] = None,
) -> None:
    """Serve HTTP; every other setting is an environment variable PNS_…."""
    check_posix("serve")
    from ..http.server import serve as run
    from ..settings import Settings

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
    from pns_common.model.file import bundled_models, load_model

    from ..model_info import print_model, print_models

    if model is None:
        print_models(load_model(name) for name in bundled_models(companions=True))
    else:
        print_model(load_model(model))


@app.command()
def doctor() -> None:
    """Show versions, models, memory and settings, and refine an example; 1 if anything is wrong."""
    from ..doctor import findings

    well = True
    for finding in findings():
        mark = "ok  " if finding.well else "FAIL"
        typer.echo(printable(f"{mark} {finding.name:<12} {finding.text}"))
        well = well and finding.well
    if not well:
        raise typer.Exit(FAILURE)


@app.command()
def example(
    output: Annotated[
        Path, typer.Argument(metavar="OUT.glb", parser=local_path, help="file to write")
    ],
) -> None:
    """Write a small mechanical part with ridges, fillets and UVs, to try the other commands on."""
    from pns_common.files import replace_file

    from ..errors import InvalidParameter
    from ..meshfiles.example import part_glb

    if output.suffix.lower() != ".glb":
        raise InvalidParameter("output", f"{output}: the example is a .glb file")
    replace_file(output, part_glb())


@app.command()
def key(
    name: Annotated[str, typer.Argument(metavar="NAME", help="a-z, 0-9 and -")],
    faces_per_minute: Annotated[
        float | None, typer.Option(help="its budget of refined faces; default: the service's")
    ] = None,
) -> None:
    """Make a key for a client of the service.

    The key goes to stderr, for its bearer and shown only now; the entry, for the file that
    PNS_KEYS_FILE names, to stdout: pns key studio >> keys.toml
    """
    from ..http.access.keys import Entry, hash_of, new_key, toml_entry

    fresh = new_key(name)
    entry = Entry(name=name, hash=hash_of(fresh), faces_per_minute=faces_per_minute)
    typer.echo(f"{toml_entry(entry)}\n")
    typer.echo(fresh, err=True)
