"""README's tables of simplified meshes say what those of results/README.md say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README, RESULTS = ((ROOT / name).read_text() for name in ("README.md", "results/README.md"))
GAINS = ("Normals %", "Largest %", "Mean %")
# A part of each name in README, and the results' name; the first that fits.
METHODS = {
    "Without either": "N1",
    "with the same crease lines": "N1, creases",
    "With crease lines, without a network": "N1, creases",
    "without crease lines": "PNS, no creases",
    "Q1": "Q1",
    "NC": "NC",
    "N1": "N1",
    "Butterfly": "Butterfly",
    "Not refining": "Flat",
    "general": "PNS",
}
# README's rows of the default model's validation numbers, one for each of GAINS.
OURS = ("Normals", "Largest distance", "Mean distance")


def table_after(text, words):
    """The cells of the first Markdown table after some words, without its rule and emphasis."""
    lines = text.partition(words)[2].partition("\n|")[2].partition("\n\n")[0].splitlines()
    rows = [[cell.strip(" *") for cell in line.strip("|").split("|")] for line in lines]
    return [rows[0], *rows[2:]]


def results(title):
    """A table of the results: its rows by faces and method."""
    heading, *rows = table_after(RESULTS, f"**{title}**")
    named = [dict(zip(heading, row, strict=True)) for row in rows]
    return {(int(row["Faces"]), row["Method"]): row for row in named}


def method_of(name):
    return next(method for part, method in METHODS.items() if part in name)


def number(text):
    return int(re.match(r"[\d,]+", text)[0].replace(",", ""))


def test_readme_has_the_numbers_of_the_test_set():
    found, faces, seen = results("Simplified meshes (test)"), 0, set()
    for name, *cells in table_after(README, "improvement over Loop in per cent")[1:]:
        if name[0].isdigit():
            faces = number(name)
            loop = found[faces, "Loop"]
            assert f"({loop['Meshes']}" in name
            assert re.findall(r"Loop(?: has)? (\d+)", name) == [loop["Self-intersecting faces"]]
            continue
        row = found[faces, method_of(name)]
        for cell, column in zip(cells[:3], GAINS, strict=True):
            assert float(cell) == pytest.approx(float(row[column]), abs=0.55), (faces, name)
        assert cells[3:] == [row["Jump / Loop's"], row["Self-intersecting faces"]], (faces, name)
        seen.add((faces, name))
    assert len(seen) == 20


def test_readme_has_the_numbers_of_the_validation_set():
    found = results("Simplified meshes (validation)")
    heading, *rows = table_after(README, "and in normals at 5,000:")
    for name, *cells in rows:
        ours = name in OURS
        columns = [GAINS[OURS.index(name)]] if ours else GAINS
        method = "PNS" if ours else method_of(name)
        for size, cell in zip(heading[1:], cells, strict=True):
            row = found[number(size), method]
            assert cell == ", ".join(row[column] for column in columns), (size, name)
