"""README's table of unseen meshes has the numbers of results/unseen.md."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README, RESULTS = ((ROOT / name).read_text() for name in ("README.md", "results/unseen.md"))
# Of mean, 95th percentile, largest and normals README leaves out the second.
SHOWN = (0, 2, 3)


def rows(text):
    """The cells of every table row by their first cell, without emphasis."""
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")]
    return {cells[0].strip(): [cell.strip(" *") for cell in cells[1:]] for cells in lines}


def numbers(cell):
    values = [float(value.replace("−", "-")) for value in cell.split(" / ")]
    return [values[place] for place in SHOWN] if len(values) == 4 else values


def test_readme_has_the_numbers_of_every_kind():
    readme, results = rows(README), rows(RESULTS)
    kinds = [name for name in results if name in readme and name.strip("-")]
    assert len(kinds) == 7
    for name in kinds:
        loop, flat, patches, ours = readme[name]
        assert (loop, flat) == ("0", "–")
        assert [numbers(ours), numbers(patches)] == list(map(numbers, results[name]))


def test_readme_has_the_numbers_of_all_meshes():
    results = rows(RESULTS)
    loop, *cells = rows(README)["All 198"]
    assert loop == "0"
    named = ("Not refining", "PN triangles, normals split at 40°", "PNS")
    for cell, name in zip(cells, named, strict=True):
        assert numbers(cell) == pytest.approx(numbers(results[name][0]), abs=0.5)
    jumps = [results[name][1] for name in ("PN triangles, normals split at 40°", "PNS")]
    assert f"up to {float(jumps[0]):.1f} times" in README
    assert f"PNS: {float(jumps[1]):.1f}" in README
