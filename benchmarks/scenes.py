"""`python -m benchmarks.scenes`: scenes of thousands of small meshes, as of CAD and buildings.

The promise: no more than half a millisecond of processor time a mesh, and a scene of 4,500 meshes
within five seconds, from the request to its answer.
"""

from __future__ import annotations

import http.client
import os
import sys
import time
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.answers import served
from pns_common import load_model
from pns_common.model.file import DEFAULT_MODEL
from service.gltf.constants import COMPONENT_TYPES
from service.gltf.read.container import encode, write_glb
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from service.workers.worker import rare_searches

Primitive = dict[str, np.ndarray]
COMPONENTS = {kind: number for number, kind in COMPONENT_TYPES.items()}


def main(
    meshes: Annotated[int, typer.Option(help="of each scene")] = 4500,
    runs: Annotated[int, typer.Option(help="of which the shortest counts")] = 3,
    model: Annotated[str, typer.Option(help="bundled model")] = DEFAULT_MODEL,
    python: Annotated[str, typer.Option(help="of the environment that serves")] = sys.executable,
) -> None:
    """Refine each scene once, here and by a service with one worker on one core."""
    table = Table("of each", "KiB", "ms of CPU a mesh", "seconds of CPU", "seconds, whole request")
    loaded, limits = load_model(model), Limits()
    with served(python, min(os.sched_getaffinity(0))) as port:
        for name, primitives in SCENES.items():
            body = scene(primitives, meshes)

            def here(body: bytes = body) -> None:
                with rare_searches():
                    subdivide_gltf(body, "glb", Options(levels=1), loaded, limits)

            def asked(body: bytes = body) -> None:
                _ask(port, body, model)

            cpu = _shortest(here, time.process_time, runs)
            wall = _shortest(asked, time.perf_counter, runs)
            per_mesh = f"{1000 * cpu / meshes:.2f}"
            table.add_row(name, f"{len(body) / 1024:.0f}", per_mesh, f"{cpu:.2f}", f"{wall:.2f}")
    Console(width=100).print(table)


def tetrahedra(rng: np.random.Generator) -> list[Primitive]:
    """Make four faces and nothing but positions."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]) * rng.uniform(0.2, 3, 3)
    faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    return [{"POSITION": points.astype(np.float32), "indices": faces.astype(np.uint16)}]


def boxes(rng: np.random.Generator) -> list[Primitive]:
    """Make six sides of four vertices each, with normals and texture coordinates."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    points, normals, faces = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            side = np.insert(corners * (1, sign), axis, sign, axis=1)
            turn = (0, 1, 2, 0, 2, 3) if axis != 1 else (0, 2, 1, 0, 3, 2)
            faces.append(np.array(turn).reshape(2, 3) + 4 * len(points))
            points.append(side)
            normals.append(np.tile(sign * np.eye(3)[axis], (4, 1)))
    size = rng.uniform(0.2, 3, 3)
    return [
        {
            "POSITION": (np.concatenate(points) * size).astype(np.float32),
            "NORMAL": np.concatenate(normals).astype(np.float32),
            "TEXCOORD_0": np.tile((corners + 1) / 2, (6, 1)).astype(np.float32),
            "indices": np.concatenate(faces).astype(np.uint16),
        }
    ]


def parted_boxes(rng: np.random.Generator) -> list[Primitive]:
    """Make a box of two primitives."""
    (whole,) = boxes(rng)
    return [whole | {"indices": part} for part in np.split(whole["indices"], 2)]


def skinned_boxes(rng: np.random.Generator) -> list[Primitive]:
    """Make a box that hangs on two joints."""
    (whole,) = boxes(rng)
    upper = whole["POSITION"][:, 2] > 0
    weights = np.where(upper[:, None], (0.25, 0.75, 0, 0), (1, 0, 0, 0))
    joints = np.where(upper[:, None], (0, 1, 0, 0), (0, 0, 0, 0))
    return [whole | {"JOINTS_0": joints.astype(np.uint8), "WEIGHTS_0": weights.astype(np.float32)}]


SCENES: dict[str, Callable[[np.random.Generator], list[Primitive]]] = {
    "tetrahedra": tetrahedra,
    "boxes": boxes,
    "boxes of two primitives": parted_boxes,
    "boxes with skins": skinned_boxes,
}


def scene(primitives: Callable[[np.random.Generator], list[Primitive]], count: int) -> bytes:
    """Make a GLB of so many meshes, none with the positions of another."""
    rng = np.random.default_rng(0)
    tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0}
    tree |= {"meshes": [], "accessors": [], "bufferViews": []}
    pieces: list[bytes] = []
    for _ in range(count):
        made = primitives(rng)
        tree["meshes"].append({"primitives": [_primitive(tree, pieces, own) for own in made]})
    nodes: list[dict[str, Any]] = [{"mesh": number} for number in range(count)]
    if any("JOINTS_0" in own["attributes"] for own in tree["meshes"][0]["primitives"]):
        tree["skins"] = [{"joints": [count, count + 1]}]
        nodes = [node | {"skin": 0} for node in nodes] + [{}, {}]
    tree |= {"nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}]}
    tree["buffers"] = [{"byteLength": sum(map(len, pieces))}]
    return write_glb(encode(tree), pieces, [])


def _primitive(tree: dict[str, Any], pieces: list[bytes], arrays: Primitive) -> dict[str, Any]:
    numbers = {}
    for name, values in arrays.items():
        rows = values.reshape(-1, 1) if name == "indices" else values
        numbers[name] = _accessor(tree, pieces, rows)
        if name == "POSITION":
            low, high = rows.min(axis=0), rows.max(axis=0)
            tree["accessors"][-1] |= {"min": low.tolist(), "max": high.tolist()}
    return {"indices": numbers.pop("indices"), "attributes": numbers}


def _accessor(tree: dict[str, Any], pieces: list[bytes], rows: np.ndarray) -> int:
    """Write an array; return the number of its accessor."""
    content = rows.tobytes()
    start = tree["bufferViews"][-1] if tree["bufferViews"] else {"byteOffset": 0, "byteLength": 0}
    offset = -(-(start["byteOffset"] + start["byteLength"]) // 4) * 4
    pieces.append(content + bytes(-len(content) % 4))
    view = {"buffer": 0, "byteOffset": offset, "byteLength": len(content)}
    tree["bufferViews"].append(view)
    kind = "SCALAR" if rows.shape[1] == 1 else f"VEC{rows.shape[1]}"
    component = COMPONENTS[rows.dtype]
    tree["accessors"].append(
        {
            "bufferView": len(tree["bufferViews"]) - 1,
            "componentType": component,
            "count": len(rows),
            "type": kind,
        }
    )
    return len(tree["accessors"]) - 1


def _shortest(run: Callable[[], None], clock: Callable[[], float], runs: int) -> float:
    """Return the seconds of the shortest, after one that is not counted."""
    run()
    seconds = []
    for _ in range(runs):
        start = clock()
        run()
        seconds.append(clock() - start)
    return min(seconds)


def _ask(port: int, body: bytes, model: str) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", port)
    kind = {"Content-Type": "model/gltf-binary"}
    connection.request("POST", f"/subdivide?levels=1&model={model}", body, kind)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    if answer.status != 200:
        raise RuntimeError(f"{answer.status}: {content[:200]!r}")


if __name__ == "__main__":
    typer.run(main)
