"""Reading, computing and writing as one run that can be driven in small steps, and stopped."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import bpy

from .losses import losses
from .reading import Reading, read_mesh
from .refining.compute import Choice, compute
from .refining.job import Job
from .refining.snapshot import Refined
from .result import remember
from .writing import write_mesh

# What one call of `advance` takes at most, but for a single piece that takes longer.
SLICE = 0.02
WAITING = object()
Steps = Generator[object, None, Any]
# What a block is found again by: its name, which one of another file may have too, and that file.
Key = tuple[str, str | None]


def key_of(block: bpy.types.ID) -> Key:
    """Return what Blender's collections find the block by, and no other."""
    return block.name, None if block.library is None else block.library.filepath


@dataclass(frozen=True, eq=False)
class Made:
    """A refined mesh, and what it came from."""

    source: bpy.types.Mesh
    mesh: bpy.types.Mesh
    refined: Refined


class Run:
    """Drives a generator a slice of time at a time; between slices the interface may draw."""

    def __init__(self, steps: Steps) -> None:
        self._steps = steps
        self.value: Any = None
        self.done = False
        # In the midst of a step: what Blender tells of now, the step has done.
        self.busy = False

    def advance(self, seconds: float = SLICE) -> bool:
        """Go on for so long, or until there is something to wait for; whether it is done.

        Raises:
            PnsError: the mesh cannot be refined, or the model fails.
        """
        end = time.monotonic() + seconds
        while not self.done:
            self.busy = True
            try:
                state = next(self._steps)
            except StopIteration as finished:
                self.done, self.value = True, finished.value
                break
            finally:
                self.busy = False
            if state is WAITING or time.monotonic() >= end:
                break
        return self.done

    def finish(self) -> Any:
        """Go on to the end; what came of it."""
        while not self.advance(60.0):
            time.sleep(0.001)
        return self.value

    def cancel(self) -> None:
        """Stop, and leave nothing behind."""
        self._steps.close()
        self.done = True


@dataclass
class Share:
    """Progress of a run, as a share."""

    value: float = 0.0
    text: str = ""


def refine_meshes(
    objects: Iterable[bpy.types.Object], choice: Choice, share: Share
) -> Generator[object, None, dict[Key, Made]]:
    """Refine the meshes of these objects; return the copies by the key of the old mesh."""
    holders = {key_of(obj.data): obj for obj in objects}
    made: dict[Key, Made] = {}
    finished = False
    try:
        for number, (key, obj) in enumerate(holders.items()):
            share.text = f"Refining {obj.name}"
            made[key] = yield from refine_mesh(obj, choice, share, number, len(holders))
        finished = True
    finally:
        if not finished:
            for unfinished in made.values():
                bpy.data.meshes.remove(unfinished.mesh)
    return made


def refine_mesh(
    obj: bpy.types.Object,
    choice: Choice,
    share: Share,
    number: int = 0,
    count: int = 1,
    into: bpy.types.Mesh | None = None,
    reading: Reading | None = None,
) -> Generator[object, None, Made]:
    """Refine a copy of an object's mesh; the computation runs in a thread of its own.

    ``into`` is written anew, if given, in place of a new mesh; ``reading`` is the mesh's, if known.
    """
    mesh: bpy.types.Mesh = obj.data
    if reading is None:
        reading = yield from read_mesh(mesh)
    job = Job(partial(compute, reading.snapshot, choice))
    try:
        while job.running:
            share.value = (number + job.share) / count
            yield WAITING
        refined = job.answer()
    finally:
        job.cancel()
    new, refused = yield from write_mesh(refined, reading, mesh, into)
    remember(new, refined, losses(obj, reading, refined) + refused)
    return Made(mesh, new, refined)
