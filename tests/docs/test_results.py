"""README's table has the numbers of results/validation.md."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README, RESULTS = ((ROOT / name).read_text() for name in ("README.md", "results/validation.md"))
NAMES = "Scans, Sculptures, Medical, Machine parts, Buildings, Game models, Terrain, All"
KINDS = "scan, sculpt, medical, part, building, game, terrain, all"
METHODS = "Flat", "PN triangles, 40°", "PNS"


def measured(kind, method):
    """Mean, 95th percentile, largest and normals on the page of results."""
    (line,) = re.findall(rf"^{kind} +{method} +([-+].*)$", RESULTS, re.MULTILINE)
    return [float(value) for value in line.split()[:4]]


def test_readme_has_the_numbers_of_every_kind():
    lines = [line.strip("|").split("|") for line in README.splitlines() if line.startswith("|")]
    shown = {cells[0].strip(): cells[1:] for cells in lines}
    for name, kind in zip(NAMES.split(", "), KINDS.split(", "), strict=True):
        loop, *others = (cell.strip(" *") for cell in shown[name])
        assert loop == "0"
        for cell, method in zip(others, METHODS, strict=True):
            mean, _, largest, normals = measured(kind, method)
            numbers = [float(value.replace("−", "-")) for value in cell.split(" / ")]
            assert numbers == [round(mean), round(largest), round(normals)]
