"""The two ways to read an edge, as cards name them."""

from dataclasses import replace

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.features.orientation import FIRST_FACE, ORIENTATIONS, SYMMETRIC
from tests.pns_common.geometry.test_frames import CREST


def test_cards_name_both():
    assert {"first-face": FIRST_FACE, "symmetric": SYMMETRIC} == ORIENTATIONS


def test_only_one_of_them_depends_on_the_order_of_the_faces():
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    read = [build_topology(faces[order], 4) for order in ([0, 1], [1, 0])]
    first, left = (
        [orientation.order(topology, topology.interior).stencil.tolist() for topology in read]
        for orientation in (FIRST_FACE, SYMMETRIC)
    )
    assert first[0] != first[1]
    assert left[0] == left[1]


def test_faces_folded_onto_each_other_have_no_curvature_in_the_symmetric_reading():
    folded = replace(CREST, n2=-CREST.n1)
    curvatures = [ORIENTATIONS[name].frames(folded).curvature[0] for name in ORIENTATIONS]
    assert curvatures == [2, 0]
