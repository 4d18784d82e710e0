"""Make a release: what users install, and nothing else is needed to install it (`make release`).

python deploy/release.py            # writes dist/release/
"""

from __future__ import annotations

import gzip
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "dist" / "release"
# What the service needs, by hash: with the wheel it is all that an installation reads.
PINS = (ROOT / "requirements" / "meshopt.txt", ROOT / "requirements" / "service.txt")
BLENDERS = ("4.5", "5.0", "5.2")


def main() -> None:
    """Write the files, install from them alone, and sum them up."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    run(sys.executable, "-m", "build", "--outdir", OUT, ROOT)
    (wheel,) = OUT.glob("*.whl")
    requirements = OUT / "requirements.txt"
    requirements.write_text("\n".join(path.read_text() for path in PINS))
    with tempfile.TemporaryDirectory() as folder:
        python = installed(Path(folder), wheel, requirements)
        run(
            "cyclonedx-py",
            "environment",
            python,
            "--output-reproducible",
            "-o",
            OUT / "sbom.cdx.json",
        )
    finished([*addons(wheel), *image(wheel)])


def finished(left_out: list[str]) -> None:
    """Write the sums of all files, and say what there is and what was left out."""
    files = sorted(path for path in OUT.iterdir() if path.is_file())
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (OUT / "SHA256SUMS").write_text("".join(sums))
    for path in files:
        print(f"{path.stat().st_size:>12,}  {path.relative_to(ROOT)}")
    for text in left_out:
        print(f"left out: {text}")


def installed(folder: Path, wheel: Path, requirements: Path) -> Path:
    """Install the release into a fresh environment, and refine the example; return its Python."""
    venv.create(folder / "venv", with_pip=True)
    python, pns = (folder / "venv" / "bin" / name for name in ("python", "pns"))
    pip = (python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps")
    run(*pip, "--require-hashes", "--requirement", requirements, cwd=folder)
    run(*pip, "--no-index", wheel, cwd=folder)
    run(python, "-m", "pip", "check", cwd=folder)
    run(pns, "doctor", cwd=folder)
    run(pns, "example", "part.glb", cwd=folder)
    run(pns, "subdivide", "part.glb", "-o", "fine.glb", cwd=folder)
    return python


def addons(wheel: Path) -> list[str]:
    """Pack the Blender extension for each Blender that is set up; return those that are not."""
    left_out: list[str] = []
    for version in BLENDERS:
        blender = ROOT / f".venv-blender-{version}"
        if not (blender / ".ready").exists():
            left_out.append(f"add-on for Blender {version}: make {blender.name}/.ready")
            continue
        before = set((ROOT / "dist").glob("pns_refine-*.zip"))
        # Empty: the platform of this machine.
        run(sys.executable, "-m", "addons.blender.build", blender / "bin" / "python", "", wheel)
        made = set((ROOT / "dist").glob("pns_refine-*.zip"))
        for path in made - before or {max(made, key=lambda path: path.stat().st_mtime)}:
            shutil.copy(path, OUT)
    return left_out


def image(wheel: Path) -> list[str]:
    """Save the container's image; return why not where no Docker answers."""
    known = shutil.which("docker")
    if (
        known is None
        or subprocess.run((known, "info"), capture_output=True, check=False).returncode
    ):
        return ["image: no docker answers here"]
    tag = f"pns:{wheel.name.split('-')[1]}"
    run("docker", "build", "--tag", tag, ROOT)
    archive = OUT / f"{tag.replace(':', '-')}-image.tar.gz"
    saved = subprocess.run(("docker", "save", tag), check=True, stdout=subprocess.PIPE).stdout
    archive.write_bytes(gzip.compress(saved, mtime=0))
    return []


def run(*command: str | Path, cwd: Path = ROOT) -> None:
    """Run a command; one that fails ends the release."""
    tools = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    subprocess.run([*map(str, command)], check=True, cwd=cwd, env={**os.environ, "PATH": tools})


if __name__ == "__main__":
    main()
