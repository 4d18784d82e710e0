"""Small libraries of files, and batches over them without processes."""

import hashlib
import io
import json
from pathlib import Path

from rich.console import Console

from service.meshfiles.example import part_glb
from service.options import Limits, Options
from service.scale.batch import Batch, run_batch
from service.scale.job import run

TETRAHEDRON = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
LOOP = Options(scheme="loop", levels=1)
KINDS = ("glb", "gltf", "obj", "ply", "stl", "off", "3mf")


def here(tasks):
    """An engine without processes."""
    return ([run(task)] for task in tasks)


def library(folder, names=("a.obj", "b/c.obj", "d.glb")):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(part_glb() if name.endswith("glb") else TETRAHEDRON)
    return folder


def batch_of(tmp_path, source=None, **changes):
    given = {
        "source": str(source or tmp_path / "in"),
        "destination": str(tmp_path / "out"),
        "options": LOOP,
        "limits": Limits(),
        "report": tmp_path / "report.jsonl",
    }
    return Batch(**(given | changes))


def refined(batch, engine=here):
    return run_batch(batch, engine, Console(file=io.StringIO()))


def rows(batch):
    return {
        Path(row["path"]).name: row
        for row in map(json.loads, batch.report.read_text().splitlines())
    }


def hashes(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
