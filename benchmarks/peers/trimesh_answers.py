"""`trimesh_answers.py FILE SECONDS`: how often a second trimesh reads, refines once and writes."""

import io
import sys
import time
from pathlib import Path

import trimesh


def answer(data: bytes) -> bytes:
    """Refine every mesh of a GLB by Loop's rules, to another GLB."""
    scene = trimesh.load(io.BytesIO(data), file_type="glb", force="scene")
    for name, mesh in scene.geometry.items():
        points, faces = trimesh.remesh.subdivide_loop(mesh.vertices, mesh.faces)
        scene.geometry[name] = trimesh.Trimesh(points, faces, process=False)
    return scene.export(file_type="glb")


def main(path: str, seconds: str) -> None:
    """Print the rate, warm."""
    data = Path(path).read_bytes()
    answer(data)
    start, count = time.perf_counter(), 0
    while (taken := time.perf_counter() - start) < float(seconds):
        answer(data)
        count += 1
    print(count / taken)


if __name__ == "__main__":
    main(*sys.argv[1:])
