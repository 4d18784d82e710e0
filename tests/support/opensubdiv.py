"""OpenSubdiv as an oracle: a small driver, built where Debian's libosd-dev and a compiler are."""

import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

SOURCE = Path(__file__).with_suffix(".cpp")


@cache
def _driver():
    """Return the built driver, or why there is none."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        return None, "OpenSubdiv's driver: no C++ compiler"
    program = Path(mkdtemp(prefix="opensubdiv-")) / "driver"
    built = subprocess.run(
        [compiler, "-O1", "-std=c++14", str(SOURCE), "-o", str(program), "-losdCPU"],
        capture_output=True,
        check=False,
    )
    return (program, "") if built.returncode == 0 else (None, "OpenSubdiv: no libosd-dev here")


def catmull_clark(points, faces, levels, creases=(), corners=(), sharpness=10):
    """Return (Q, 4) positions, limits and two limit tangents at the corners of refined quads.

    ``creases`` are as sharp as ``sharpness``, one or one each, at so many levels. ``corners`` are
    pairs: vertices, and their sharpness. 10 and more is for good.
    """
    return _refined(4, points, faces, levels, creases, corners, sharpness)


def loop(points, faces, levels, creases=(), corners=(), sharpness=10):
    """Return what ``catmull_clark`` does, (T, 3) for triangles by Loop's scheme."""
    return _refined(3, points, faces, levels, creases, corners, sharpness)


def _refined(degree, points, faces, levels, creases, corners, sharpness):
    program, reason = _driver()
    if program is None:
        pytest.skip(reason)
    counts = degree, len(points), len(faces), len(creases), len(corners), levels
    lines = [" ".join(map(str, counts))]
    lines += [" ".join(f"{x:.17g}" for x in point) for point in points]
    lines += [" ".join(map(str, [len(face), *map(int, face)])) for face in faces]
    each = np.broadcast_to(sharpness, len(creases))
    lines += [f"{a} {b} {s:.9g}" for (a, b), s in zip(creases, each, strict=True)]
    lines += [f"{v} {sharpness:.9g}" for v, sharpness in corners]
    ran = subprocess.run(
        [program], input="\n".join(lines), capture_output=True, text=True, check=True
    )
    made = np.array(ran.stdout.split(), dtype=float).reshape(-1, degree, 4, 3)
    return tuple(made[:, :, k] for k in range(4))
