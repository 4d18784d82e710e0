"""OpenSubdiv as an oracle: a small driver, built where Debian's libosd-dev and a compiler are."""

import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

SOURCE = Path(__file__).resolve().parents[1] / "library" / "catmull_clark.cpp"


@cache
def _driver():
    """Return the built driver, or why there is none."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        return None, "OpenSubdiv's driver: no C++ compiler"
    program = Path(mkdtemp(prefix="opensubdiv-")) / "catmull_clark"
    built = subprocess.run(
        [compiler, "-O1", "-std=c++14", str(SOURCE), "-o", str(program), "-losdCPU"],
        capture_output=True,
        check=False,
    )
    return (program, "") if built.returncode == 0 else (None, "OpenSubdiv: no libosd-dev here")


def catmull_clark(points, faces, levels, creases=()):
    """Return (Q, 4) positions, limits and two limit tangents at the corners of refined quads."""
    program, reason = _driver()
    if program is None:
        pytest.skip(reason)
    lines = [f"{len(points)} {len(faces)} {len(creases)} {levels}"]
    lines += [" ".join(f"{x:.17g}" for x in point) for point in points]
    lines += [" ".join(map(str, [len(face), *map(int, face)])) for face in faces]
    lines += [f"{a} {b}" for a, b in creases]
    ran = subprocess.run(
        [program], input="\n".join(lines), capture_output=True, text=True, check=True
    )
    made = np.array(ran.stdout.split(), dtype=float).reshape(-1, 4, 4, 3)
    return tuple(made[:, :, k] for k in range(4))
