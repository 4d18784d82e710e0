"""The wheel, and environments that hold it and what it asks for: no network, nothing else."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from packaging.metadata import Metadata
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]


def run(*arguments: Any, **options: Any) -> str:
    """Standard output of a command that succeeds."""
    command = [str(argument) for argument in arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def checkout(folder: Path) -> Path:
    """A copy of what git knows, so that a file that was never added is missed by a test."""
    for name in filter(None, run("git", "ls-files", "-z", cwd=ROOT).split("\0")):
        if (ROOT / name).is_file():
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((ROOT / name).read_bytes())
    return folder


def environment(folder: Path, wheel: Path, extras: set[str]) -> Path:
    """A virtual environment with the wheel and what it requires, linked from this one: `bin`."""
    run(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / "bin" / "python"
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet"]
    run(*pip, "--no-deps", "--no-index", wheel)
    (metadata,) = site.glob("pns_subdivision-*.dist-info/METADATA")
    parsed = Metadata.from_email(metadata.read_bytes(), validate=False)
    for name in closure(parsed.requires_dist or [], extras, own=parsed.name):
        _link(name, site)
    return folder / "bin"


def closure(requirements: list[Requirement], extras: set[str], own: str) -> set[str]:
    """Names of the distributions that requirements lead to; our own extras among them."""
    names: set[str] = set()
    waiting = [(requirement, extras) for requirement in requirements]
    while waiting:
        requirement, asked = waiting.pop()
        marker = requirement.marker
        if marker and not any(marker.evaluate({"extra": extra}) for extra in (asked or {""})):
            continue
        if requirement.name == own:
            waiting += [(each, requirement.extras) for each in requirements]
        elif requirement.name not in names:
            names.add(requirement.name)
            theirs = distribution(requirement.name).requires or []
            waiting += [(Requirement(each), set(requirement.extras)) for each in theirs]
    return names


def _link(name: str, site: Path) -> None:
    """Link a distribution's modules and metadata."""
    installed = distribution(name)
    tops = {Path(file).parts[0] for file in installed.files or [] if Path(file).parts[0] != ".."}
    for top in tops - {"__pycache__"}:
        target = site / top
        if not target.exists():
            target.symlink_to(str(installed.locate_file(top)))
