"""The bare loop that a batch is measured beside, as anybody would write it.

python -m benchmarks.scale.loop SOURCE OUTPUT FIRST STEP: each STEP-th file from FIRST on. It asks
for the report of each file too, whose certificate is in a batch's rows.
"""

from __future__ import annotations

import sys
from pathlib import Path

from service.meshfiles.convert import converted
from service.options import Limits, Options

SCHEME, LEVELS = "loop", 3


def main() -> None:
    """Refine the files."""
    source, output, first, step = sys.argv[1:]
    options = Options(scheme=SCHEME, levels=LEVELS)
    for path in sorted(Path(source).iterdir())[int(first) :: int(step)]:
        made = converted(path.read_bytes(), "obj", "obj", options, None, Limits())
        assert made.report["levels"]
        (Path(output) / path.name).write_bytes(made.content)


if __name__ == "__main__":
    main()
