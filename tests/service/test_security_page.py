"""docs/security.md names tests that there are."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "security.md").read_text()
TESTS: dict[str, str] = {}
for path in (ROOT / "tests").rglob("test_*.py"):
    # Two folders may have a file of one name.
    TESTS[path.name] = TESTS.get(path.name, "") + path.read_text()
# The page's other tables are of figures.
PROMISES = PAGE.split("| Promise | Test |")[1].split("\n\n")[0]
ROWS = [line for line in PROMISES.splitlines() if line.startswith("| ") and "`" in line]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[2:40])
def test_every_promise_has_its_test(row):
    shown = row.rsplit("|", 2)[1]
    files = re.findall(r"(test_\w+\.py)", shown)
    folders = re.findall(r"`(tests/[\w/]+/)`", shown)
    assert files or folders
    assert all(name in TESTS for name in files)
    assert all((ROOT / folder).is_dir() for folder in folders)
    for name, function in re.findall(r"(test_\w+\.py)::(\w+)", shown):
        assert f"def {function}(" in TESTS[name], function
