"""docs/gltf.md promises, and names the tests that hold it: they exist."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_test_that_the_page_names_exists():
    page = (ROOT / "docs" / "gltf.md").read_text()
    named = set(re.findall(r"`(test_\w+)`", page))
    existing = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(), re.MULTILINE)
    }
    assert named <= existing
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    heads = [row for row in rows if row.endswith("| Held by |")]
    assert len(heads) == 2
    assert all("`test_" in row for row in rows if row not in heads)
