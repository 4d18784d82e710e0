"""The shared collection of glTF assets, what becomes of each, and what three.js makes of both."""

import base64
import csv
from functools import cache
from pathlib import Path

import numpy as np

from pns_common import load_model
from service.bodies.sibling_files import folder_of
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support import node_tools
from tests.support.shared import SHARED

# What `make test` looks at: one level of the default model, and one of Loop. The rest is breadth.
LOOKED_AT = ((0, None), (1, "pns"), (1, "loop"))
BREADTH = ((2, "pns"), (2, "loop"))
# Files that break their promises, or have nothing to refine: code and pointer of their refusal.
REFUSED = {
    "IndexOutOfRange.gltf": ("invalid-gltf", "/accessors/0"),
    "BoxWithInfinites.glb": ("invalid-gltf", "/accessors/2"),
    "empty_nodes.glb": ("unrefinable-mesh", "/meshes"),
}


def _rows():
    table = SHARED / "assets" / "assets.csv"
    if not table.exists():
        return {}
    with table.open(newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if row["format"] in ("glb", "gltf")]
    paths = {path.name: path for path in (SHARED / "assets").rglob("*.gl*")}
    return {row["name"]: {**row, "path": paths[row["name"]]} for row in rows}


ROWS = _rows()
NAMES = sorted(set(ROWS) - set(REFUSED))


@cache
def refined(name, levels, scheme="pns"):
    """The refined GLB and its report."""
    path = ROWS[name]["path"]
    # Loop's own steps are compared with another implementation, which knows no limit surface.
    options = Options(levels=levels, scheme=scheme, limit=scheme != "loop")
    media = path.suffix.removeprefix(".")
    return subdivide_gltf(
        path.read_bytes(), media, options, _model(), Limits(), siblings=folder_of(path)
    )


@cache
def _model():
    # What is promised of a file holds for any model: the one that most files will meet.
    return load_model()


class Conformance:
    """Refined assets as files, and one run each of the validator and of three.js over all."""

    def __init__(self, folder):
        self.folder, self.paths, self._meshes = folder, {}, {}
        self._messages, self._loaded, self._ready = {}, {}, set()

    def prepare(self, settings):
        """Refine, validate and load all assets, once for some levels and their schemes."""
        if settings in self._ready:
            return
        self._ready.add(settings)
        paths = {}
        for name in NAMES:
            for levels, scheme in settings:
                if levels == 0:
                    paths[name, 0, None] = ROWS[name]["path"]
                    continue
                path = self.folder / f"{Path(name).stem}-{levels}-{scheme}.glb"
                path.write_bytes(refined(name, levels, scheme).glb)
                paths[name, levels, scheme] = path
        checked = [path for (_, _, scheme), path in paths.items() if scheme != "loop"]
        self.paths |= paths
        self._messages |= node_tools.run("validate.mjs", checked)
        self._loaded |= node_tools.run("load.mjs", paths.values())

    def path(self, name, levels, scheme):
        """The file of an asset, as it is or refined."""
        self.prepare(LOOKED_AT if (levels, scheme) in LOOKED_AT else BREADTH)
        return str(self.paths[name, levels, scheme])

    def originals(self):
        """The meshes of all assets as they are."""
        paths = [ROWS[name]["path"] for name in NAMES]
        loaded = node_tools.run("load.mjs", paths)
        return [
            [_arrays(p) for p in mesh if p["triangles"]]
            for path in paths
            for mesh in loaded[str(path)]["meshes"]
        ]

    def errors(self, name, levels, scheme):
        """The validator's error codes."""
        messages = self._messages[self.path(name, levels, scheme)]
        return {message["code"] for message in messages if message["severity"] == 0}

    def loaded(self, name, levels, scheme):
        """Return what three.js made of the file."""
        return self._loaded[self.path(name, levels, scheme)]

    def meshes(self, name, levels, scheme):
        """The meshes as three.js has them, each a list of primitives as arrays."""
        key = name, levels, scheme
        if key not in self._meshes:
            meshes = self.loaded(*key)["meshes"]
            self._meshes[key] = [[_arrays(p) for p in mesh if p["triangles"]] for mesh in meshes]
        return self._meshes[key]


def _arrays(primitive):
    """Faces over the vertices that they use, and what these carry."""
    indices = np.frombuffer(base64.b64decode(primitive["indices"]), np.uint32)
    return {
        "faces": indices.astype(np.int64).reshape(-1, 3),
        "points": _floats(primitive["position"], 3),
        "targets": [_floats(target, 3) for target in primitive["targets"]],
        "joints": _floats(primitive.get("skinIndex", ""), 4),
        "weights": _floats(primitive.get("skinWeight", ""), 4),
    }


def _floats(text, width):
    return np.frombuffer(base64.b64decode(text), np.float32).reshape(-1, width)
