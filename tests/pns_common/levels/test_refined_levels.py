"""What is kept of the levels: a report that is made when it is asked for, and coordinates."""

import numpy as np
import pytest

from pns_common import MeshError
from pns_common.base.deferred import Deferred
from pns_common.connectivity.topology import build_topology
from pns_common.levels.refined_levels import LevelsReport, RefinedLevels, check_coordinates
from tests.support.meshes import TETRAHEDRON


@pytest.mark.parametrize(
    ("largest", "why"), [(np.nan, "not numbers"), (np.inf, "too large"), (1.1e75, "too large")]
)
def test_coordinates_that_nothing_can_be_computed_with_are_refused(largest, why):
    with pytest.raises(MeshError, match=why) as refusal:
        check_coordinates(largest)
    assert refusal.value.element == "vertices"
    check_coordinates(1e75)


def test_the_levels_are_looked_at_once_and_not_before_they_are_asked_for():
    looks = []

    def look():
        looks.append(1)
        return LevelsReport([], multi_fan_vertices=3)

    made = RefinedLevels(
        np.zeros((4, 3)),
        TETRAHEDRON,
        np.zeros(4),
        np.zeros(4),
        Deferred(look),
        lambda: build_topology(TETRAHEDRON, 4),
    )
    assert looks == []
    assert (made.multi_fan_vertices, made.reports, looks) == (3, [], [1])
