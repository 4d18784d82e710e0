"""Edges of primitives that viewers draw as lines, by CESIUM_primitive_outline: read, refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from pns_common.mesh.topology import Topology, halves_of

from .attributes import RefinedPrimitive
from .control_mesh import ControlMesh

Outlines = dict[int, Int[np.ndarray, "N 2"]]


def refined_outlines(control: ControlMesh, levels: Sequence[Topology]) -> Outlines:
    """Return the outlines of primitives that have some, by number, as edges of the refined mesh.

    `levels` are the topologies that are refined, control mesh first; none where faces have several
    levels. Lines that are no edges of it,
    such as diagonals of polygons, are left out.
    """
    made: Outlines = {}
    for number, primitive in enumerate(control.primitives):
        if primitive.outline is None or not levels:
            continue
        vertex = control.weld.vertex_of[control.rows[number]]
        used = vertex >= 0
        # An element of the file may have several rows, in one place.
        of_element = np.full(1 + int(primitive.rows.max()), -1)
        of_element[primitive.rows[used]] = control.cleaned.vertex_map[vertex[used]]
        given = primitive.outline[(primitive.outline < len(of_element)).all(axis=1)]
        pairs = of_element[given]
        keys = [levels[0].vertex_count, 1]
        known = np.isin(np.sort(pairs, axis=1) @ keys, levels[0].edges.astype(np.int64) @ keys)
        pairs = pairs[known & (pairs >= 0).all(axis=1)]
        # Faces that are not refined keep their edges.
        chains = [pairs]
        for topology in levels:
            chains.append(halves_of(topology, topology.rows_of(chains[-1])))
        made[primitive.number] = np.concatenate([chains[0], chains[-1]])
    return made


def with_outline(refined: RefinedPrimitive, outlines: Outlines) -> RefinedPrimitive:
    """Return a refined primitive with the sides of its faces that lie on its outline."""
    edges = outlines.get(refined.source.number)
    if edges is None:
        return refined
    if refined.vertex is None:
        raise ValueError("the vertices of the refined mesh are not known")
    sides = np.stack([refined.faces, np.roll(refined.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    keys = [1 + max(int(refined.vertex.max(initial=0)), int(edges.max(initial=0))), 1]
    wanted = np.sort(edges, axis=1) @ keys
    on = np.isin(np.sort(refined.vertex[sides], axis=1) @ keys, wanted)
    rows = np.unique(np.sort(sides[on], axis=1), axis=0)
    return replace(refined, outline=rows.astype(np.int64))
