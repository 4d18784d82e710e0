"""The formats of mesh files, as their names end: to ask about them loads no reader."""

from __future__ import annotations

GLTF_KINDS = ("glb", "gltf")
MESH_KINDS = ("obj", "ply", "stl", "off")
KINDS = (*GLTF_KINDS, *MESH_KINDS)
