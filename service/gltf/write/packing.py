"""Writers that compress the refined geometry: `compress=draco`, `compress=meshopt`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import meshopt
import numpy as np
from jaxtyping import Shaped

from ...course import Course
from ...report import Change
from ..read.compressed import draco
from ..read.extensions import declare
from ..read.schema import Accessor
from ..refine.refined_primitives import RefinedPrimitive
from . import draco_encode
from .writer import Writer, describe

# The form that all readers know; KHR_meshopt_compression adds a version of it.
MESHOPT = "EXT_meshopt_compression"
# Bytes that encoding takes for each refined face, at its peak: at least 1.2 times what was measured
# with normals and UVs on 200,000 faces that share no vertex (609 and 58).
BYTES_PER_FACE = {"none": 0, "draco": 750, "meshopt": 80}


@dataclass
class MeshoptWriter(Writer):
    """Compresses each view of refined geometry, exactly; `expanded` bytes if it were decoded."""

    expanded: int = 0
    views: int = 0

    def stored(self, content: Shaped[np.ndarray, "N B"]) -> dict[str, Any]:
        """Append compressed elements; a view into a buffer that has no bytes."""
        attributes = content.dtype == np.uint8
        mode = "ATTRIBUTES" if attributes else "TRIANGLES"
        rows = content if attributes else content.reshape(-1)
        data = meshopt.encode_gltf_buffer(np.ascontiguousarray(rows), mode)
        view = {
            "buffer": 1,
            "byteOffset": self.expanded,
            "byteLength": content.nbytes,
            "extensions": {
                MESHOPT: {
                    "buffer": 0,
                    "byteOffset": self.append(memoryview(data)),
                    "byteLength": len(data),
                    "byteStride": content.shape[1] * content.itemsize,
                    "count": len(content),
                    "mode": mode,
                }
            },
        }
        # Whole words: so are rows of attributes, and there are four times as many faces as before.
        self.expanded += content.nbytes
        self.views += 1
        return view

    def bytes_of(self, view: dict[str, Any]) -> dict[str, Any]:
        """Return the object that says where a view's bytes lie in BIN."""
        return view.get("extensions", {}).get(MESHOPT, view)

    def finish(self) -> list[bytes | memoryview]:
        """Write the buffers' lengths into the tree; the pieces of BIN."""
        pieces = super().finish()
        if self.views:
            placeholder = {"byteLength": self.expanded, "extensions": {MESHOPT: {"fallback": True}}}
            self.tree["buffers"].append(placeholder)
            declare(self.tree, MESHOPT)
        return pieces

    def changes(self) -> list[Change]:
        """Return what was compressed."""
        return [Change("/bufferViews", "compressed by meshopt, exactly", self.views)]


@dataclass
class DracoWriter(Writer):
    """Compresses each primitive that Draco can hold; rounds positions, normals and UVs."""

    encoded: int = 0
    plain: list[Change] = field(default_factory=list)
    grid: draco_encode.Grid | None = None

    def replace_mesh(self, mesh: int, refined: Sequence[RefinedPrimitive], course: Course) -> int:
        """Compress the primitives of a mesh on one grid; the vertices written."""
        if refined:
            positions = [primitive.attributes["POSITION"] for primitive in refined]
            self.grid = draco_encode.grid_of(positions)
        return super().replace_mesh(mesh, refined, course)

    def replace(self, mesh: int, refined: RefinedPrimitive) -> int:
        """Point a primitive at its compressed geometry, or at plain geometry; the vertices."""
        primitive = self.tree["meshes"][mesh]["primitives"][refined.source.number]
        made = self._encoded(refined)
        if made is None:
            pointer = f"/meshes/{mesh}/primitives/{refined.source.number}"
            self.plain.append(Change(pointer, "not compressed: Draco cannot hold it", 1))
            return super().replace(mesh, refined)
        before = refined.source.accessors
        primitive["attributes"] = {
            name: self._described(before.get(name), name, values)
            for name, values in made.attributes.items()
        }
        indices = self.add_accessor(made.faces.reshape(-1, 1), "SCALAR", None)
        self.set_indices(primitive, indices)
        primitive.pop("mode", None)
        data = np.frombuffer(made.data, np.uint8).reshape(-1, 1)
        primitive.setdefault("extensions", {})[draco.EXTENSION] = {
            "bufferView": self.add_view(self.stored(data)),
            "attributes": made.ids,
        }
        self.encoded += 1
        return len(made.attributes["POSITION"])

    def finish(self) -> list[bytes | memoryview]:
        """Write the buffer's length into the tree; the pieces of BIN."""
        if self.encoded:
            declare(self.tree, draco.EXTENSION)
        return super().finish()

    def changes(self) -> list[Change]:
        """Return what was compressed, and what was not."""
        what = "compressed by Draco: positions, normals and texture coordinates rounded"
        return [*([Change("/meshes", what, self.encoded)] if self.encoded else []), *self.plain]

    def _encoded(self, refined: RefinedPrimitive) -> draco_encode.Encoded | None:
        # Draco reorders vertices; deltas of morph targets, which it does not hold, would be lost.
        if refined.targets or self.grid is None or not draco_encode.can_encode(refined.attributes):
            return None
        return draco_encode.encode(refined.attributes, refined.faces, self.grid)

    def _described(
        self, before: Accessor | None, name: str, values: Shaped[np.ndarray, "N K"]
    ) -> int:
        index = self.add_accessor(values, "SCALAR" if before is None else before.type, None)
        describe(self.tree["accessors"][index], before, name, values)
        return index


WRITERS: dict[str, type[Writer]] = {
    "none": Writer,
    "draco": DracoWriter,
    "meshopt": MeshoptWriter,
}
