"""`python train/run.py certify [MODEL.onnx]`: pass or fail for each property, with its number."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from pns_common import PnsError
from pns_common.files import replace_file
from train.certificates.bodies import Body, real_bodies
from train.certificates.certify import (
    Verdict,
    certify_model_file,
    own_table,
    verdict_json,
    verdict_table,
)
from train.output_file import prepare_output


def certify_command(
    model: Annotated[
        str | None, typer.Argument(help="Model file, or a bundled name; the default if not given.")
    ] = None,
    meshes: Annotated[
        Path | None,
        typer.Option(
            exists=True, file_okay=False, help="Folder of obj, off, ply and stl files to add."
        ),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="Theorem to certify, as T4; may be given again.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option(dir_okay=False, help="File to write the verdict to.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the meshes and motions.")] = 0,
) -> None:
    """Certify a model file, also one that someone else made; exit 1 if a certificate fails."""
    console = Console()
    try:
        real = () if meshes is None else real_bodies(meshes)
        if json is not None:
            prepare_output(json)
        verdict = _certify_with_progress(model, real, seed, only or [], console)
    except PnsError as error:
        console.print(escape(str(error)), style="red", soft_wrap=True)
        raise typer.Exit(2) from error
    if json is not None:
        replace_file(json, verdict_json(verdict))
    if not verdict.is_model:
        (broken,) = verdict.certificates
        line = f"{verdict.name}: no model: {broken.name} failed: {broken.where}"
        console.print(escape(line), style="red", soft_wrap=True)
        raise typer.Exit(1)
    console.print(verdict_table(verdict))
    if verdict.own:
        console.print(own_table(verdict))
    failed = [
        certificate.name
        for certificate in verdict.certificates
        if certificate.counts and not certificate.passed
    ]
    failed += [f"theorem 4 on {own.name}" for own in verdict.own if own.failed]
    if failed:
        console.print(f"failed: {escape('; '.join(failed))}", style="red", soft_wrap=True)
        raise typer.Exit(1)
    console.print("every certificate passed", style="green")


def _certify_with_progress(
    model: str | None, real: tuple[Body, ...], seed: int, only: Sequence[str], console: Console
) -> Verdict:
    columns = (
        TextColumn("{task.description:<24}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("loading")

        def on_progress(title: str, done: int, total: int) -> None:
            progress.update(task, description=title, completed=done, total=total)
            if not console.is_terminal:
                console.print(f"{done} of {total}: {title}")

        return certify_model_file(model, real, seed, on_progress, only=only)
