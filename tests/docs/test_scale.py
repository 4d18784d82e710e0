"""docs/scale.md says what benchmarks/scale.json holds of the largest runs that are kept there."""

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "scale.md").read_text()
RUNS = json.loads((ROOT / "benchmarks" / "scale.json").read_text())


def test_the_page_has_the_numbers_of_a_hundred_million_faces():
    run = RUNS["large-100000000"]
    seconds, faces = run["processor_seconds"], run["faces"]
    driver, worker = (run[f"{who}_proportional_bytes"] / 2**20 for who in ("driver", "worker"))
    (row,) = (line for line in PAGE.splitlines() if line.startswith(f"| {faces:,} faces"))
    assert f"{run['parts']} parts, two workers" in row
    assert f"| {run['wall_seconds']:.0f} s; {seconds:.0f} s of processor time" in row
    assert f"at most {driver:.0f} MiB in the driver and {worker:.0f} in a worker" in row
    assert f"a hundred million faces\n{seconds:.0f} seconds" in PAGE


def test_the_page_has_the_numbers_of_ten_thousand_files():
    one, two = (RUNS[f"batch-{workers}"]["batch_seconds"] for workers in (1, 2))
    assert f"one worker {one:.1f} s" in PAGE
    assert f"two workers {two:.1f} s" in PAGE
    assert f"two cores {two:.0f} seconds" in PAGE
