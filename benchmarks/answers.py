"""`python -m benchmarks.answers`: glTF files answered a second on one core, beside other programs.

Uploads of 1, 10 and 100 kB, refined once. Ours is `pns serve` over HTTP, server and worker on one
core and the client on another; the others are called in their own process, without HTTP: trimesh's
Loop, and three-subdivide's between gltf-transform's reader and writer (gltf-transform has no
subdivision of its own).
"""

from __future__ import annotations

import http.client
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.generated import torus
from service.meshfiles.glb import triangles_glb
from service.meshfiles.mesh_file import of_triangles

ROOT = Path(__file__).resolve().parents[1]
PEERS = Path(__file__).with_name("peers")
SIZES = (1_000, 10_000, 100_000)
# So that the server always has a request that waits.
CLIENTS = 2
BUDGETS = {"PNS_WORKERS": "1", "PNS_FACES_PER_MINUTE": "1e12", "OMP_NUM_THREADS": "1"}
PROGRAMS = {
    "trimesh": [str(ROOT / ".venv-bench/bin/python"), str(PEERS / "trimesh_answers.py")],
    "gltf-transform + three-subdivide": ["node", str(PEERS / "gltf_answers.mjs")],
}


def main(
    seconds: Annotated[float, typer.Option(help="how long each is asked, each time")] = 3.0,
    rounds: Annotated[int, typer.Option(help="times that all are asked in turn")] = 3,
    python: Annotated[str, typer.Option(help="of the environment that serves")] = sys.executable,
) -> None:
    """Measure them in turn, and print medians."""
    rates: dict[str, dict[int, list[float]]] = {}
    missing: dict[str, str] = {}
    cores = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder, served(python, cores[0]) as port:
        os.sched_setaffinity(0, {cores[-1]})
        uploads = {size: Path(folder) / f"{size}.glb" for size in SIZES}
        for size, path in uploads.items():
            path.write_bytes(upload(size))
        for _ in range(rounds):
            for size, path in uploads.items():
                for query in ("", "&scheme=loop"):
                    name = f"pns serve, {'loop' if query else 'default model'}"
                    rate = asked(port, f"/subdivide?levels=1{query}", path.read_bytes(), seconds)
                    rates.setdefault(name, {}).setdefault(size, []).append(rate)
                for name, command in PROGRAMS.items():
                    if name not in missing:
                        try:
                            rate = program_rate(command, path, seconds, cores[0])
                            rates.setdefault(name, {}).setdefault(size, []).append(rate)
                        except (OSError, ValueError, subprocess.SubprocessError) as error:
                            missing[name] = str(error)
    table = Table("answers a second", *(f"{size // 1000} kB" for size in SIZES))
    for name, by_size in rates.items():
        table.add_row(name, *(f"{median(by_size[size]):.1f}" for size in SIZES))
    console = Console()
    console.print(table)
    for name, reason in missing.items():
        console.print(f"left out: {name} ({reason})")


def upload(size: int) -> bytes:
    """Return the largest torus whose file is no larger than ``size`` bytes."""
    data, faces = b"", 8
    while len(larger := _glb(faces)) <= size:
        data, faces = larger, faces + max(4, faces // 20)
    return data


def _glb(faces: int) -> bytes:
    mesh = torus(faces)
    return triangles_glb(of_triangles(mesh.vertices, mesh.faces))


@contextmanager
def served(python: str, core: int) -> Iterator[int]:
    """Run `pns serve` with one worker, on one core; yields its port."""
    command = [python, "-m", "service", "serve", "--port", "0"]
    server = subprocess.Popen(
        ["taskset", "--cpu-list", str(core), *command],
        cwd=ROOT,
        env={**os.environ, **BUDGETS},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    assert server.stderr is not None
    try:
        for line in server.stderr:
            if where := re.search(r"running on http://[^:]+:(\d+)", line):
                break
        else:
            raise RuntimeError("the server did not start")
        with ThreadPoolExecutor(1) as reader:
            reader.submit(server.stderr.read)
            yield int(where[1])
            server.terminate()
    finally:
        server.terminate()
        server.wait()


def asked(port: int, path: str, body: bytes, seconds: float) -> float:
    """Return the answers a second of a server that is asked without a pause."""
    with ThreadPoolExecutor(CLIENTS) as clients:
        list(clients.map(lambda _: _ask(port, path, body, 0.5), range(CLIENTS)))
        start = time.perf_counter()
        counts = clients.map(lambda _: _ask(port, path, body, seconds), range(CLIENTS))
        return sum(counts) / (time.perf_counter() - start)


def _ask(port: int, path: str, body: bytes, seconds: float) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", port)
    end, count = time.perf_counter() + seconds, 0
    while time.perf_counter() < end:
        connection.request("POST", path, body, {"Content-Type": "model/gltf-binary"})
        answer = connection.getresponse()
        content = answer.read()
        if answer.status != 200:
            raise RuntimeError(f"{answer.status}: {content[:200]!r}")
        count += 1
    connection.close()
    return count


def program_rate(command: list[str], upload_path: Path, seconds: float, core: int) -> float:
    """Return the answers a second of a program that prints it."""
    done = subprocess.run(
        ["taskset", "--cpu-list", str(core), *command, str(upload_path), str(seconds)],
        capture_output=True,
        text=True,
        check=True,
        timeout=60 + 10 * seconds,
    )
    return float(done.stdout.split()[-1])


if __name__ == "__main__":
    typer.run(main)
