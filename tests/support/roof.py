"""The features of one edge by name: the crest of a roof."""

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import FEATURE_COUNT, FEATURE_SETS
from pns_common.features.orientation import SYMMETRIC
from pns_common.geometry.frames import edge_frames, edge_stencil, face_normals
from pns_common.geometry.rings import Rings

# A roof: the edge from 0 to 1 is its crest, 4 units long; both sides fall by 3 over 4.
ROOF = np.array([[0.0, 0, 3], [4, 0, 3], [2, -4, 0], [2, 4, 0]])
SIDES = np.array([[0, 2, 1], [0, 1, 3]])


def on_roof(name, points=ROOF, faces=SIDES):
    """The features of the crest, by name."""
    features, topology = FEATURE_SETS[name], build_topology(faces, len(points))
    edges = SYMMETRIC.order(topology, topology.interior)
    normals = face_normals(points, faces)
    fields = features.fields(Rings(topology, points, normals))
    stencil = edge_stencil(points, normals, edges.stencil, edges.faces, fields)
    names = [f"{feature.kind} {feature.vertices}".strip() for feature in features.features]
    values = features(stencil, edge_frames(stencil))
    assert values.shape == (1, FEATURE_COUNT[name])
    return dict(zip(names, values[0].tolist(), strict=True))
