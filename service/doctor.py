"""`pns doctor`: what is installed here, and whether it refines as it must."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata

PACKAGES = ("numpy", "onnx", "onnxruntime")
# A refinement keeps its bound up to rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Finding:
    """One line of the report: what was looked at, what was found, and whether that is well."""

    name: str
    text: str
    well: bool = True


def findings() -> Iterator[Finding]:
    """Yield what is found, in the order in which one thing needs another."""
    from pns_common.version import VERSION

    yield Finding("pns", f"{VERSION}, Python {platform.python_version()}, {platform.platform()}")
    yield from map(_package, PACKAGES)
    yield _machine()
    for name, check in (
        ("settings", _settings),
        ("kernels", _kernels),
        ("providers", _providers),
        ("models", _models),
        ("self-test", _self_test),
    ):
        try:
            yield Finding(name, check())
        except Exception as error:
            yield Finding(name, f"{type(error).__name__}: {error}", well=False)


def _package(name: str) -> Finding:
    try:
        return Finding(name, metadata.version(name))
    except metadata.PackageNotFoundError:
        return Finding(name, f"not installed: pip install {name}", well=False)


def _machine() -> Finding:
    from pns_common.memory import memory_here

    bytes_here = memory_here()
    size = "unknown" if bytes_here is None else f"{bytes_here / 2**30:.1f} GiB"
    return Finding("machine", f"{os.cpu_count()} processors, {size} of memory")


def _settings() -> str:
    from pydantic import ValidationError

    from .http.access.keys import read_keys
    from .settings import PREFIX, Settings

    try:
        settings = Settings()
    except ValidationError as error:
        raise ValueError(error.errors()[0]["msg"].removeprefix("Value error, ")) from error
    if settings.keys_file is not None:
        read_keys(settings.keys_file)
    given = sorted(name for name in os.environ if name.upper().startswith(PREFIX))
    return ", ".join(given) if given else f"no {PREFIX}… variable is set"


def _kernels() -> str:
    from pns_common.kernels import AHEAD

    return "compiled ahead of time" if AHEAD else "compiled by numba at the first call of each"


def _providers() -> str:
    from pns_common.model.session import onnx_runtime

    return ", ".join(onnx_runtime().get_available_providers())


def _models() -> str:
    from pns_common import load_model
    from pns_common.model.file import bundled_models

    loaded = [load_model(name) for name in bundled_models()]
    return ", ".join(f"{model.name} {model.hash[:8]}" for model in loaded)


def _self_test() -> str:
    """Refine the example; raise where it breaks a promise.

    Raises:
        AssertionError: the result has another size, a vertex beyond its bound, or is not Loop's at
            budget 0.
    """
    import numpy as np

    from pns_common import Mesh, load_model, loop, pns, refine

    from .meshes.weld import weld
    from .meshfiles.example import part

    began = time.perf_counter()
    triangles = part()
    welded = weld(triangles.vertices, triangles.faces)
    mesh, model = Mesh(welded.points, welded.faces), load_model()
    made = refine(mesh, pns(model), 2)
    ratio = max(level["proximity_ratio"]["max"] for level in made.report["levels"])
    by_loop = refine(mesh, loop(), 2, creases=None).mesh.vertices
    without = refine(mesh, pns(model, budget=0), 2, creases=None).mesh.vertices
    promises = {
        f"{16 * len(mesh.faces)} faces": len(made.mesh.faces) == 16 * len(mesh.faces),
        "finite vertices": bool(np.isfinite(made.mesh.vertices).all()),
        f"a ratio of at most 1, found {ratio}": ratio <= 1 + ROUNDING,
        "Loop's vertices at budget 0": bool(np.allclose(by_loop, without, rtol=0, atol=1e-12)),
    }
    if broken := [promise for promise, held in promises.items() if not held]:
        raise AssertionError(f"expected {'; '.join(broken)}")
    return f"{len(made.mesh.faces):,} faces, all promises kept, {time.perf_counter() - began:.1f} s"
