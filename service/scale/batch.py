"""`pns batch`: refine a library of files, each in a worker of its own, and go on after a stop."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import chain, islice
from pathlib import Path

from rich.console import Console

from ..bodies.media import ALIASES, KINDS
from ..errors import InvalidParameter, NoModelError, ServiceError
from ..options import Limits, Options
from .console import Summary, count_aside, line_of, progress
from .engines.work import Engine, Work
from .job import FAILED, UNREADABLE_FOLDER, Row, Task, failed, read_libraries, run, target_of
from .journal import Journal, check_report, open_journal
from .places import Place, place_of
from .sources import Item, items_of


@dataclass(frozen=True)
class Batch:
    """Options that a batch applies to each file.

    Attributes:
        source, destination: paths or URLs; a folder, glob or file, and a folder.
        to: the format of all results; None: each its own.
        model: a bundled name or a file; None: the default model.
        report: the JSON lines file; what is needed to go on lies beside it.
        dry: say what would be done, and write nothing but that.
    """

    source: str
    destination: str
    options: Options
    limits: Limits
    report: Path
    to: str | None = None
    model: str | None = None
    dry: bool = False


# Files that are looked up in the journal together.
LOOK_UP = 64


def batch_work(seconds: float, job: Callable[[Task], Row] = run) -> Work[Task, Row]:
    """Return what is done with each file, which may take so many seconds."""

    def lost(task: Task, error: ServiceError) -> Row:
        return replace(failed(task.url, task.output, error), attempts=task.attempt)

    return Work(job, lost, seconds, read_libraries)


def run_batch(batch: Batch, engine: Engine[Task, Row], console: Console) -> Summary:
    """Refine all files of a source; the report is written at the end, also after an interruption.

    Raises:
        InvalidParameter: the source, the destination, the report, the model or a format cannot be
            used.
    """
    check_report(batch.report)
    if batch.to is not None and batch.to not in KINDS:
        raise InvalidParameter("to", f"{batch.to}: it must be one of {', '.join(KINDS)}")
    listing = items_of(batch.source, (*KINDS, *ALIASES), place_of(batch.destination))
    items = listing()
    if (first := next(items, None)) is None:
        text = f"{batch.source}: there is no file to refine ({', '.join(KINDS)})"
        raise InvalidParameter("SOURCE", text)
    model = model_hash(batch)
    destination = _destination(batch)
    counts: Counter[str] = Counter()
    faces: Counter[str] = Counter()
    codes: Counter[str] = Counter()
    with open_journal(batch.report, work_hash(batch, model)) as journal, progress(console) as bar:
        line = bar.add_task("refining", total=None, failed=0)
        count_aside(listing, bar, line)

        def note(rows: list[Row]) -> None:
            journal.put(rows)
            for row in rows:
                counts[row.status] += 1
                faces[row.status] += row.faces_out
                if row.status == FAILED:
                    codes[row.code] += 1
            if said := [text for row in rows if (text := line_of(row))]:
                console.print("\n".join(said), markup=False)
            bar.update(line, advance=len(rows), failed=counts[FAILED])

        for rows in engine(_tasks(batch, model, chain([first], items), destination, journal, note)):
            note(rows)
    failures = sorted(codes.items(), key=lambda entry: (-entry[1], entry[0]))
    return Summary(batch.report, dict(counts), dict(faces), failures)


def model_hash(batch: Batch) -> str | None:
    """Return the hash of the model that a batch refines with; None without one.

    Raises:
        NoModelError: there is no such model, or it cannot be used.
        InvalidParameter: it is of no use with these options.
    """
    if not batch.options.learns:
        return None
    from pns_common import ModelError, load_model

    from ..gltf.subdivide import make_scheme

    try:
        loaded = load_model(batch.model)
    except ModelError as error:
        raise NoModelError(str(error)) from error
    make_scheme(batch.options, loaded)
    return loaded.hash


def work_hash(batch: Batch, model: str | None) -> str:
    """Return what, beside its input, a result depends on, as one hash: options, model, format."""
    parts = {
        "options": asdict(batch.options),
        "model": model,
        "to": batch.to,
        "destination": place_of(batch.destination).url,
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _destination(batch: Batch) -> Place:
    """Return where the results go.

    Raises:
        InvalidParameter: nothing can be written there.
    """
    destination = place_of(batch.destination)
    if batch.dry:
        return destination
    try:
        destination.check_writable()
    except OSError as error:
        text = f"{batch.destination}: nothing can be written there: {error.strerror}"
        raise InvalidParameter("DEST", text) from error
    return destination


def _tasks(
    batch: Batch,
    model: str | None,
    items: Iterator[Item],
    destination: Place,
    journal: Journal,
    reject: Callable[[list[Row]], None],
) -> Iterator[Task]:
    while block := list(islice(items, LOOK_UP)):
        tasks: list[Task] = []
        rejected: list[Row] = []
        with journal.together():
            for item in block:
                try:
                    tasks.append(_task(batch, model, item, destination, journal))
                except ServiceError as error:
                    rejected.append(failed(_shown(item.url), "", error))
        if rejected:
            reject(rejected)
        yield from tasks


def _task(
    batch: Batch, model: str | None, item: Item, destination: Place, journal: Journal
) -> Task:
    """Return what is to be done with a file, with what is known of it.

    Raises:
        ServiceError: nothing can be made of it, or not there.
    """
    if _shown(item.url) != item.url:
        # Neither a journal nor a report can hold it.
        raise ServiceError("its name is not in UTF-8", code="unreadable-name")
    if item.fault:
        raise ServiceError(f"nothing in it is refined: {item.fault}", code=UNREADABLE_FOLDER)
    kind, target, relative = target_of(item.relative, batch.to)
    place = destination.below(relative)
    output = place.url
    if place.path_to(place_of(item.url)) == ".":
        text = "its result would take its place; give results a folder of their own"
        raise ServiceError(text, code="output-is-source")
    if not batch.dry and not journal.claim(output, item.url):
        taken = f"{output} is another file's result; give each source a folder of its own"
        raise ServiceError(taken, code="output-taken")
    return Task(
        item.url,
        output,
        kind,
        target,
        batch.options,
        batch.model,
        batch.limits,
        model,
        known=journal.known(item.url),
        dry=batch.dry,
    )


def _shown(url: str) -> str:
    """Show a name as text: bytes of a file's name that are no UTF-8 are spelled out."""
    return url.encode(errors="backslashreplace").decode()
