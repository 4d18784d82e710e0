"""A glTF file from bytes to bytes, by stage: seconds, and peak memory above what stood before."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Literal, get_args

from benchmarks.generated import torus, unrolled_torus
from benchmarks.memory import in_fresh_process, peak_mib, reset_peak
from pns_common import load_model
from service.bodies.sibling_files import ALONE, SiblingFiles, folder_of
from service.errors import ServiceError
from service.gltf.subdivide import Subdivided, subdivide_gltf
from service.meshfiles.glb import triangles_glb
from service.meshfiles.mesh_file import of_triangles
from service.options import Limits, Options
from service.stages import Stages

RUNS = 5
# What a generated file has beside positions, or gets on the way.
Shading = Literal["", "new normals", "normals and UVs"]
SHADINGS: tuple[Shading, ...] = get_args(Shading)
STAGES = ("read", "weld", "refine", "attributes", "write")


@dataclass
class MemoryCourse(Stages):
    """Also keeps each stage's peak memory, in MiB above what stood at the start."""

    mib: dict[str, float] = field(default_factory=dict)
    base: float = 0.0

    def book(self, stage: str, seconds: float) -> None:
        """Book the time, and the peak since anything was booked."""
        super().book(stage, seconds)
        self.mib[stage] = max(self.mib.get(stage, 0.0), peak_mib() - self.base)
        reset_peak()


@dataclass(frozen=True)
class MeasuredFile:
    """Cost of one file, medians of its runs; ``refused`` says why it was not refined."""

    faces: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    mib: dict[str, float] = field(default_factory=dict)
    refused: str | None = None


def measure_file(path: Path, levels: int, model: str | None = None) -> MeasuredFile:
    """Refine a file on disk in a process of its own; `model` is a name or file, or the default."""
    data = path.read_bytes()
    return in_fresh_process(_measure, data, levels, model, False, folder_of(path))


def measure_generated(
    faces: int, levels: int, model: str | None = None, *, shading: Shading = ""
) -> MeasuredFile:
    """Refine a generated GLB of about so many faces in a process of its own."""
    if shading == "normals and UVs":
        data = triangles_glb(unrolled_torus(faces))
    else:
        mesh = torus(faces)
        data = triangles_glb(of_triangles(mesh.vertices, mesh.faces))
    return in_fresh_process(_measure, data, levels, model, shading == "new normals")


def _measure(
    data: bytes,
    levels: int,
    source: str | None,
    normals: bool,
    siblings: SiblingFiles = ALONE,
) -> MeasuredFile:
    model, limits = load_model(source), Limits(max_faces=10**8, max_memory_bytes=10**11)
    media = "glb" if data[:4] == b"glTF" else "gltf"
    options = Options(levels, normals="smooth" if normals else "keep")

    def run(stages: Stages) -> Subdivided:
        return subdivide_gltf(data, media, options, model, limits, stages=stages, siblings=siblings)

    try:
        done = run(Stages())  # warm
    except ServiceError as error:
        return MeasuredFile(refused=f"{error.code}: {error.detail}")
    runs = [run(Stages()).timings for _ in range(RUNS)]
    seconds = {stage: median(timings[stage] for timings in runs) for stage in runs[0]}
    # Apart from the times: asking for a peak makes the next touch of every page a slow one.
    reset_peak()
    stages = MemoryCourse(base=peak_mib())
    run(stages)
    return MeasuredFile(done.report["totals"]["faces"], seconds, stages.mib)
