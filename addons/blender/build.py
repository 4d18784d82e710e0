"""Build the extension: the wheels it needs beside it, packed and checked by Blender's own tool.

python -m addons.blender.build PYTHON                       # PYTHON has bpy (`make addon`)
python -m addons.blender.build PYTHON windows-x64 LIBRARY   # for another platform

onnxruntime's wheel is for one platform and one version of Python: that of PYTHON, Blender's own.
The library's wheel is for one platform, and any Python from 3.11 on. It is built here for this
platform; for another, LIBRARY is the wheel that ``library_wheel`` built there:

python -c "from addons.blender.build import *; library_wheel(Path('dist'))"
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pns_common.files import replace_file

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(__file__).with_name("pns_refine")
CORE = Path(__file__).with_name("core.toml")
DIST = ROOT / "dist"
# What the library imports, and Blender does not have; pinned by constraints.txt.
REQUIRED = ("jaxtyping", "wadler-lindig", "onnxruntime")
# Blender's names of platforms, and those of wheels.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_14_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
}
PLATFORM_OF = {"Linux": "linux-x64", "Windows": "windows-x64", "Darwin": "macos-arm64"}
# What is asked of Blender's Python.
FACTS = """
import bpy, platform, sys
from pathlib import Path
print("%d.%d" % sys.version_info[:2])
print(platform.system())
scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
print(next(scripts.glob("addons_core/bl_pkg/cli/blender_ext.py")))
"""


def main(python: str, platform: str | None = None, library: str | None = None) -> None:
    """Build the zip, and let Blender validate what was packed."""
    version, system, tool = said(python, "-c", FACTS).splitlines()[-3:]
    platform = platform or PLATFORM_OF.get(system, system)
    if platform not in PLATFORMS:
        raise SystemExit(f"{platform}: expected one of {', '.join(PLATFORMS)}")
    if library is None and platform != PLATFORM_OF.get(system):
        raise SystemExit(f"{platform}: name a wheel of the library that was built there")
    with tempfile.TemporaryDirectory() as folder:
        stage, packed = Path(folder) / "pns_refine", Path(folder) / "packed"
        packed.mkdir()
        staged(stage, platform, version, library)
        print(said(python, tool, "build", "--source-dir", stage, "--output-dir", packed))
        (built,) = packed.glob("*.zip")
        print(said(python, tool, "validate", built))
        DIST.mkdir(exist_ok=True)
        target = DIST / f"{built.stem}-{platform}-python{version}.zip"
        replace_file(target, built.read_bytes())
    print(f"{target}: {target.stat().st_size:,} bytes")


def staged(stage: Path, platform: str, version: str, library: str | None) -> None:
    """Stage the extension's folder as it is packed: sources, licence, wheels, and a manifest."""
    shutil.copytree(SOURCE, stage, ignore=shutil.ignore_patterns("__pycache__"))
    wheels = stage / "wheels"
    collect_wheels(wheels, platform, version)
    if library is None:
        library_wheel(wheels)
    else:
        shutil.copy(library, wheels)
    manifest = stage / "blender_manifest.toml"
    names = sorted(path.name for path in wheels.iterdir())
    manifest.write_text(with_wheels(manifest.read_text(), names, platform))


def with_wheels(manifest: str, names: Sequence[str], platform: str) -> str:
    """Return the manifest with its platform and a list of wheels at its end."""
    listed = "".join(f'  "./wheels/{name}",\n' for name in names)
    return f'{manifest.rstrip()}\nplatforms = ["{platform}"]\nwheels = [\n{listed}]\n'


def collect_wheels(folder: Path, platform: str, version: str) -> None:
    """Collect the wheels that the library needs, as published.

    ``version`` is that of Python, such as 3.11.
    """
    folder.mkdir(parents=True)
    tags = [f"--platform={tag}" for tag in PLATFORMS[platform]]
    wanted = [f"--python-version={version}", "--constraint", ROOT / "constraints.txt", *REQUIRED]
    pip = (sys.executable, "-m", "pip", "--quiet", "download", "--no-deps", "--only-binary=:all:")
    said(*pip, *tags, "--dest", folder, *wanted)


def library_wheel(folder: Path) -> None:
    """Build the wheel of the library alone, for this platform."""
    with tempfile.TemporaryDirectory() as copy:
        source = clean_copy(Path(copy) / "source")
        shutil.copy(CORE, source / "pyproject.toml")
        shutil.rmtree(source / "service")
        pip = (sys.executable, "-m", "pip", "--quiet", "wheel", "--wheel-dir", folder)
        said(*pip, "--no-deps", "--no-build-isolation", source)


def clean_copy(folder: Path) -> Path:
    """Copy the project without what builds leave in it, which would get into the wheel."""
    listed = said("git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    return folder


def said(*command: object) -> str:
    """Return what a command prints; what it complains of is shown if it fails."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout.strip()


if __name__ == "__main__":
    main(*sys.argv[1:])
