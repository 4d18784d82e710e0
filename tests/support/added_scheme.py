"""The base scheme of the documentation, added by a file and a line."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "python.md"
# Python runs it at the start of each process, workers too: here without a file changed.
LINE = """
from pns_common.scheme_names import BASE_SCHEMES

BASE_SCHEMES["linear"] = "linear:LINEAR"
"""


def with_linear(folder: Path) -> dict[str, str]:
    """Write the scheme to a folder; returns the environment in which Python knows it."""
    (code,) = re.findall(r"```python\n([^`]*BaseScheme\([^`]*)```", PAGE.read_text())
    (folder / "linear.py").write_text(code)
    (folder / "sitecustomize.py").write_text(LINE)
    return {"PYTHONPATH": f"{folder}:{ROOT}"}


def halved(obj: str) -> bool:
    """Return whether a file holds the triangle of TRIANGLE with its edges halved."""
    lines = obj.splitlines()
    points = {tuple(map(float, line.split()[1:4])) for line in lines if line.startswith("v ")}
    return points == {(0, 0, 0), (4, 0, 0), (0, 4, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)}


TRIANGLE = "v 0 0 0\nv 4 0 0\nv 0 4 0\nf 1 2 3\n"
