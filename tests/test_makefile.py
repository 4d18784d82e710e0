"""`make` sets up the pinned versions, wherever the checkout lies."""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_pip_finds_the_pins_in_a_folder_with_a_blank_in_its_name(tmp_path):
    folder = tmp_path / "my checkout"
    folder.mkdir()
    for name in ("Makefile", "constraints.txt"):
        shutil.copy(ROOT / name, folder)
    asks = f"ask:\n\t{sys.executable} -m pip install --dry-run --no-index numpy\n"
    (folder / "ask.mk").write_text(f"include Makefile\n{asks}")
    done = subprocess.run(
        ["make", "-f", "ask.mk", "ask"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
