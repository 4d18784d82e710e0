"""List the peers that are set up: drivers that `make bench` built, libraries in its environment."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILT, PYTHON = ROOT / "build" / "bench", ROOT / ".venv-bench" / "bin" / "python"
DRIVERS = {"OpenSubdiv": "opensubdiv", "CGAL": "cgal", "OpenMesh": "openmesh"}
LIBRARIES = {"libigl": "igl", "trimesh": "trimesh", "PyVista": "pyvista", "Open3D": "open3d"}


def available_peers() -> tuple[dict[str, list[str]], dict[str, str]]:
    """Return how each peer is started, and why the others are missing."""
    peers: dict[str, list[str]] = {}
    missing: dict[str, str] = {}
    for name, driver in DRIVERS.items():
        if (BUILT / driver).exists():
            peers[name] = [str(BUILT / driver)]
        else:
            missing[name] = "its driver is not built: make bench"
    script = str(Path(__file__).with_name("python_peer.py"))
    for name, module in LIBRARIES.items():
        if _imports(module):
            peers[name] = [str(PYTHON), script, name.lower()]
        else:
            missing[name] = "it does not import in .venv-bench: make bench"
    return peers, missing


def _imports(module: str) -> bool:
    if not PYTHON.exists():
        return False
    probe = subprocess.run(
        [str(PYTHON), "-c", f"import {module}"], capture_output=True, check=False, timeout=300
    )
    return probe.returncode == 0
