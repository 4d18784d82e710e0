"""`pns subdivide`: from one file to another, by way of what both formats can hold."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.progress import Progress

from pns_common import load_model
from service import formats
from service.errors import InvalidParameter
from service.files import replace_file
from service.flatten import flatten
from service.folder import folder_of
from service.gltf.extras import REPORT_KEY
from service.gltf.report import Change
from service.options import Limits, Options
from service.refine_soup import refine_soup
from service.single_precision import rounding_changes
from service.soup import TriangleSoup
from service.soup_glb import as_gltf_json, soup_glb
from service.subdivide import make_scheme, subdivide_gltf

KINDS = (*formats.GLTF_KINDS, *formats.MESH_KINDS)


def convert(
    source: Path,
    output: Path,
    options: Options,
    model: str | None,
    report_file: Path | None,
    limits: Limits,
) -> None:
    """Refine `source` into `output`; what was changed or lost goes to stderr and the report.

    `model` is a bundled name or a file; None: the default one.

    Raises:
        ServiceError, PnsError: the file, the model or a parameter cannot be used.
        OSError: a file cannot be read or written.
    """
    kind, target = _kind("IN", source), _kind("OUT", output)
    if report_file is not None and report_file.resolve() in (source.resolve(), output.resolve()):
        raise InvalidParameter("report", f"{report_file}: the report would replace a model")
    began = time.perf_counter()
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    data = source.read_bytes()
    # Loop needs none, but one that is named and does not exist is a mistake to be told.
    loaded = load_model(model) if options.scheme == "pns" or model is not None else None
    with _progress(console) as advance:
        if kind in formats.GLTF_KINDS:
            done = subdivide_gltf(
                data, kind, options, loaded, limits, advance, neighbours=folder_of(source)
            )
            written = _of_gltf(done.glb, done.report, target, limits)
        else:
            soup = formats.read(data, kind)
            refined, report = refine_soup(
                soup, make_scheme(options, loaded), options, limits, advance
            )
            written = _of_soup(refined, report, target, options, limits)
    replace_file(output, written.content)
    if report_file is not None:
        text = msgspec.json.format(msgspec.json.encode(written.report), indent=2)
        replace_file(report_file, text + b"\n")
    for line in _lines(written.report):
        console.print(line, markup=False)
    seconds = time.perf_counter() - began
    console.print(f"{output}: {written.faces:,} faces in {seconds:.1f} s", markup=False)


def _lines(report: dict[str, Any]) -> Iterator[str]:
    """What was changed or lost, and where, each thing once."""
    for change in report["changes"]:
        where = f" ({change['pointer']})" if change["pointer"] else ""
        yield f"{change['count']} × {change['what']}{where}"
    said = {change["what"] for change in report["changes"]}
    for name, count in report["dropped"].items():
        what = f"{name.replace('_', ' ')} dropped"
        if count and what not in said:
            yield f"{count} × {what}"


def _kind(name: str, path: Path) -> str:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise InvalidParameter(name, f"{path}: the extension must be one of {', '.join(KINDS)}")
    return kind


@dataclass(frozen=True)
class Written:
    """An output file: its bytes, its report, its faces."""

    content: bytes
    report: dict[str, Any]
    faces: int


def _of_gltf(glb: bytes, report: dict[str, Any], target: str, limits: Limits) -> Written:
    faces = report["totals"]["faces"]
    if target == "glb":
        return Written(glb, report, faces)
    if target == "gltf":
        return Written(as_gltf_json(glb, limits), report, faces)
    soup, changes = flatten(glb, target, limits)
    if target not in formats.HOLDS_DOUBLE:
        changes += rounding_changes(soup)
    # A mesh that several nodes show is there several times.
    return Written(formats.write(soup, target), _with_changes(report, changes), len(soup.faces))


def _of_soup(
    refined: TriangleSoup, report: dict[str, Any], target: str, options: Options, limits: Limits
) -> Written:
    changes = [] if target in formats.HOLDS_DOUBLE else rounding_changes(refined)
    if refined.uv is not None and target not in formats.HOLDS_UV:
        changes.append(Change("", "texture coordinates dropped: the format cannot hold them", 1))
    if options.diagnostics == "full":
        changes.append(Change("", "values at vertices dropped: only a glTF's are kept", 1))
    if options.compress != "none":
        changes.append(Change("", "not compressed: only a glTF that came as one is", 1))
    report = _with_changes(report, changes)
    faces = len(refined.faces)
    if target not in formats.GLTF_KINDS:
        return Written(formats.write(refined, target), report, faces)
    extras = {} if options.diagnostics == "none" else {REPORT_KEY: report}
    glb = soup_glb(refined, extras=extras)
    return Written(glb if target == "glb" else as_gltf_json(glb, limits), report, faces)


def _with_changes(report: dict[str, Any], changes: list[Change]) -> dict[str, Any]:
    return report | {"changes": [*report["changes"], *(asdict(change) for change in changes)]}


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """A bar that shows on a terminal while faces are made, and leaves nothing behind."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("refining", total=None)

        def advance(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield advance
