"""Pages promise, and name the tests that hold it: they exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
EXISTING = {
    name
    for path in (ROOT / "tests").rglob("test_*.py")
    for name in re.findall(r"^def (test_\w+)", path.read_text(), re.MULTILINE)
}


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.stem)
def test_every_test_that_a_page_names_exists(page):
    assert set(re.findall(r"\b(test_\w+)`", page.read_text())) <= EXISTING


def test_every_case_of_gltf_names_the_tests_that_hold_it():
    rows = [line for line in (DOCS / "gltf.md").read_text().splitlines() if line.startswith("| ")]
    heads = [row for row in rows if row.endswith("| Held by |")]
    assert len(heads) == 2
    assert all("`test_" in row for row in rows if row not in heads)
