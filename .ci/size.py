"""Print Python lines and files by package; fail where one is larger than .ci/size.json allows.

Lower a budget by editing its line there; raising one needs a reason in the commit.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Print the table; return 1 where a budget is exceeded."""
    budgets: dict[str, list[int]] = json.loads((ROOT / ".ci" / "size.json").read_text())
    listed = subprocess.run(
        ["git", "ls-files", "*.py"], capture_output=True, text=True, check=True, cwd=ROOT
    )
    names = [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    print(f"{'':12} {'lines':>7} {'of':>7} {'files':>6} {'of':>5}")
    exceeded = False
    for package, (most_lines, most_files) in budgets.items():
        own = [ROOT / name for name in names if name.startswith(f"{package}/")]
        lines = sum(path.read_text().count("\n") for path in own)
        over = lines > most_lines or len(own) > most_files
        exceeded |= over
        row = f"{package:12} {lines:7,} {most_lines:7,} {len(own):6} {most_files:5}"
        print(row + ("   over" if over else ""))
    return int(exceeded)


if __name__ == "__main__":
    sys.exit(main())
