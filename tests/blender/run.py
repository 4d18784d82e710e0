"""Refine a skinned and a morphed asset, let Blender import and animate both, render one frame each.

python -m tests.blender.run PYTHON     # PYTHON has bpy (`make blender`); writes docs/blender-*.png
"""

import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from pns_common import load_model
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.shared import SHARED

ROOT = Path(__file__).resolve().parents[2]
RENDER = Path(__file__).with_name("render.py")
LEVELS = 2


@dataclass(frozen=True)
class Scene:
    """An asset, the frame of its first clip to show, and the picture's name."""

    asset: str
    frame: int
    picture: str


SCENES = (
    Scene("Fox.glb", 8, "blender-skin.png"),
    Scene("AnimatedMorphSphere.glb", 36, "blender-morph.png"),
)


def main(python):
    """Render every scene, the asset on the left and what became of it on the right."""
    for scene in SCENES:
        source = SHARED / "assets" / scene.asset
        if not source.exists():
            print(f"{scene.asset}: skipped, the shared data is not beside the project")
            continue
        with tempfile.TemporaryDirectory() as folder:
            refined = Path(folder) / scene.asset
            options, limits = Options(levels=LEVELS), Limits()
            made = subdivide_gltf(source.read_bytes(), "glb", options, load_model(), limits)
            refined.write_bytes(made.glb)
            before, after = render(python, scene, [source, refined])
        check(scene, before, after)
        print(f"{scene.asset}: {before['faces']} faces, {after['faces']} refined: {scene.picture}")


def render(python, scene, files):
    """Return what Blender made of the files."""
    output = ROOT / "docs" / scene.picture
    command = [python, RENDER, output, scene.frame, *files]
    done = subprocess.run([*map(str, command)], check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def check(scene, before, after):
    """The same bones, groups and keys at the same values, and about the same size in this pose."""
    assert after["faces"] == before["faces"] * 4**LEVELS, scene
    for name in ("bones", "groups", "keys"):
        assert after[name] == before[name], (scene, name)
    for old, new in zip(before["size"], after["size"], strict=True):
        assert 0.8 * old < new < 1.05 * old, scene


if __name__ == "__main__":
    main(sys.argv[1])
