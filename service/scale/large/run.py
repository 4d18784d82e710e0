"""`pns large`: one mesh, cut into parts that fit into memory, refined as if it had not been."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from pns_common.fused import load_kernels
from pns_common.geometry.crease_lines import is_edged
from pns_common.geometry.side_lengths import SideLengths
from pns_common.pieces import LevelTally, reduced_report
from pns_common.schemes import Scheme

from ...errors import InvalidParameter, ServiceError, WorkerDied
from ...meshes.shape_creases import lines_of
from ..engines.work import Engine, Work
from . import adjacency, partition
from .arrays import ArrayMesh, blocks_of
from .formats import OutputKind, input_mesh, output_kind
from .numbering import write_bases
from .part import (
    COUNT,
    EDGES,
    REFINE,
    TURNS,
    PartDone,
    PartTask,
    done_file,
    run_part,
    scheme_of,
)
from .plan import Large, check_unchanged, damaged, keep, kept, work_folder
from .room import check_room
from .survey import Survey, survey, used_vertices
from .target import Target
from .tiles import Tiles

# What a worker takes: beside any part, and for each face that it makes (docs/scale.md).
BASE_BYTES = 300 * 1024**2
BYTES_PER_FACE = 700

# A part is no worse than its neighbours: what kills its workers is likely to come from outside.
MOST_ATTEMPTS = 10


def large_work(job: Callable[[PartTask], PartDone] = run_part) -> Work[PartTask, PartDone]:
    """Return what is done with each part, which may take any time."""

    def lost(task: PartTask, error: ServiceError) -> PartDone:
        hint = "more --parts, or less --memory, makes them smaller"
        raise WorkerDied(f"part {task.part}: {error}; {hint}")

    return Work(job, lost, MOST_ATTEMPTS, None)


@dataclass
class Spent:
    """What a run took: wall seconds of each stage, and of its parts seconds and memory."""

    seconds: dict[str, float] = field(default_factory=dict)
    part_seconds: list[float] = field(default_factory=list)
    peak_bytes: int = 0

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what happens inside."""
        began = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - began


def run_large(
    large: Large, engine: Engine[PartTask, PartDone], console: Console
) -> tuple[dict[str, Any], Spent]:
    """Refine a mesh of any size; what an earlier run of the same has done is not done again.

    Returns the report, which is also where the output has room for it, and what the run took.

    Raises:
        ServiceError, PnsError: the input, the model or a parameter cannot be used.
        OSError: a file cannot be read or written.
    """
    kind = output_kind(large.output)
    if large.options.crease == "normals":
        raise InvalidParameter("crease", "crease=normals: none are read; use angle:DEGREES here")
    scheme = scheme_of(large.options, large.model)
    spent = Spent()
    with work_folder(large, scheme.model_hash) as work:
        with spent.stage("read"):
            mesh, read = input_mesh(large.source, work)
            check_unchanged(large, work)
        with spent.stage("survey"):
            about = _surveyed(mesh, work)
        length = _length(large, about)
        parts = large.parts or parts_for(about.faces * 4**large.options.levels, large.memory)
        if parts > about.faces:
            raise InvalidParameter("parts", f"{parts} parts of {about.faces} faces")
        if not (work / partition.ORDER).exists():
            check_room(work, about, large.options.levels, kind)
        with spent.stage("cut"):
            _cut(mesh, about, parts, work)
        with spent.stage("kernels"):
            # Where they are not compiled yet: here once, not in each worker.
            load_kernels()

        def tasks(stage: str, **known: Any) -> list[PartTask]:
            task = PartTask(
                stage=stage,
                part=0,
                parts=parts,
                mesh=str(mesh.folder.resolve()),
                work=str(work.resolve()),
                options=large.options,
                model=large.model,
                model_hash=scheme.model_hash,
                length=length,
                sides=about.sides,
                memory=None if large.parts else large.memory,
                **known,
            )
            left = (part for part in range(parts) if not done_file(work, stage, part).exists())
            return [replace(task, part=part) for part in left]

        gentle = mesh.creases is None and lines_of(large.options, scheme).edged_angle is not None
        counts = (EDGES,) * kind.numbered + (TURNS,) * gentle
        with spent.stage("count"):
            if counts:
                _do(tasks(COUNT, counts=counts), parts, engine, console, Spent())
            vertices = _numbered(about, parts, large.options.levels, work) if kind.numbered else ()
            edged = is_edged(*_turns(parts, work)) if gentle else None
        target = _target(kind, mesh, about, vertices, large.options.levels, work)
        with spent.stage("refine"):
            _do(
                tasks(REFINE, vertices=vertices, target=target, edged=edged),
                parts,
                engine,
                console,
                spent,
            )
        with spent.stage("finish"):
            if large.source.is_dir():
                check_unchanged(large, work)
            done = [kept(done_file(work, REFINE, part)) for part in range(parts)]
            fitted = scheme.fitted(lambda: about.sides)
            report = _report(fitted, length, about, done, read)
            kind.finish(target, work, large.output, report, [part["box"] for part in done])
    return report, spent


def parts_for(faces: int, memory: int) -> int:
    """Return how many parts a mesh needs whose workers may take so many bytes each.

    Raises:
        InvalidParameter: too few for any part.
    """
    room = (memory - BASE_BYTES) // BYTES_PER_FACE
    if room < 1000:
        least = (BASE_BYTES + 1000 * BYTES_PER_FACE) // 1024**2 + 1
        raise InvalidParameter("memory", f"{memory} bytes; a worker needs {least} MiB or more")
    return max(1, math.ceil(faces / room))


def _surveyed(mesh: ArrayMesh, work: Path) -> Survey:
    file = work / "survey.json"
    known = kept(file)
    if known is None:
        known = asdict(survey(mesh))
        keep(file, known)
    sides = SideLengths(**known.pop("sides"))
    return Survey(sides=sides, **known)


def _length(large: Large, about: Survey) -> float:
    given = large.options.reference_length
    return about.reference_length if given == "auto" else float(given)


def _cut(mesh: ArrayMesh, about: Survey, parts: int, work: Path) -> None:
    if not (work / partition.ORDER).exists():
        partition.cut(mesh, about, parts, work)
    if not (work / adjacency.FACES_AT).exists():
        adjacency.build(mesh, work)
    adjacency.check_creases(mesh, adjacency.Adjacency.open(work))


def _numbered(about: Survey, parts: int, levels: int, work: Path) -> tuple[int, ...]:
    """Return how many vertices each level has; their numbers lie in the folder then."""
    file = work / "numbered.json"
    if not file.exists():
        own = partition.Parts.open(work, parts).own
        counted = ((own(part), _counted(work, part, EDGES)) for part in range(parts))
        keep(file, write_bases(counted, about.vertices, about.faces, levels, work))
    return tuple(kept(file))


def _turns(parts: int, work: Path) -> list[int]:
    """Return how many edges of the whole turn by more than each of the angles."""
    return np.sum([_counted(work, part, TURNS) for part in range(parts)], axis=0).tolist()


def _counted(work: Path, part: int, what: str) -> np.ndarray:
    file = done_file(work, COUNT, part)
    try:
        with np.load(file) as counted:
            return counted[what]
    except (ValueError, EOFError, BadZipFile) as error:
        raise damaged(file) from error


def _target(
    kind: OutputKind,
    mesh: ArrayMesh,
    about: Survey,
    vertices: tuple[int, ...],
    levels: int,
    work: Path,
) -> Target | Tiles:
    """Make the files that the parts write into, with the vertices that no face uses."""
    file = work / "target.json"
    if not file.exists():
        last = vertices[-1] if vertices else 0
        target = kind.new(work, about, last, about.faces * 4**levels)
        if isinstance(target, Target) and about.isolated:
            used = used_vertices(mesh)
            for rows in blocks_of(len(used)):
                ids = rows.start + np.flatnonzero(~used[rows])
                # Loop's rule leaves them where they are, but for the sign of −0.
                target.write_vertices(ids, np.asarray(mesh.positions[ids], dtype=np.float64) + 0.0)
        keep(file, asdict(target))
    values = {name: _as_tuple(value) for name, value in kept(file).items()}
    return Target(**values) if kind.numbered else Tiles(**values)


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _do(
    tasks: list[PartTask],
    parts: int,
    engine: Engine[PartTask, PartDone],
    console: Console,
    spent: Spent,
) -> None:
    """Do tasks of a stage; what they took is added to ``spent``."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        line = bar.add_task("parts", total=parts, completed=parts - len(tasks))
        for parts_done in engine(iter(tasks)):
            for done in parts_done:
                spent.part_seconds.append(done.seconds)
                spent.peak_bytes = max(spent.peak_bytes, done.peak_bytes)
            bar.advance(line, len(parts_done))


def _report(
    scheme: Scheme, length: float, about: Survey, done: list[Any], read: dict[str, Any]
) -> dict[str, Any]:
    """Return the report: that of ``refine`` without percentiles, and what was not read."""
    tallies = ([LevelTally.of_dict(level) for level in part["levels"]] for part in done)
    reduced = reduced_report(tallies)
    for level in reduced["levels"]:
        level["vertices"] += about.isolated
    return {
        "scheme": scheme.name,
        "budget": scheme.budget,
        "model": scheme.model,
        "model_hash": scheme.model_hash,
        "reference_length": length,
        "prior_strength": scheme.prior_strength,
        "multi_fan_vertices": sum(part["multi_fan_vertices"] for part in done),
        **reduced,
        **read,
    }
