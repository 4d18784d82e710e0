"""Parts refined at once: each has its own unit of length and its own report."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, ParameterError, loop, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.fused.refine_parts import Units, refine_parts_fused
from tests.support.kernels import by_kernels
from tests.support.meshes import bow_tie, bumpy_sphere
from tests.support.networks import scale_free_model

PARTS = [Mesh(*bumpy_sphere(1, subdivisions=0)), Mesh(*bow_tie())]
BOTH = Mesh(
    np.concatenate([part.vertices for part in PARTS]),
    np.concatenate([PARTS[0].faces, PARTS[1].faces + 12]),
)
STARTS = np.array([0, 20, 22])
LENGTHS, STRENGTHS = np.array([0.5, 3.0]), np.array([1.1, 0.7])
UNITS = Units(LENGTHS, STRENGTHS)


def with_strength(scheme, strength):
    """The scheme with an s of its own; Loop has none."""
    if scheme.prior_strength is None:
        return scheme
    rules = {
        name: replace(rule, form=replace(rule.form, prior_strength=strength))
        for name, rule in (("edge_rule", scheme.edge_rule), ("vertex_rule", scheme.vertex_rule))
    }
    return replace(scheme, **rules)


@pytest.mark.parametrize("scheme", [loop(), pns(scale_free_model(0))], ids=["loop", "pns"])
def test_each_part_is_what_it_is_alone(scheme):
    made = refine_parts_fused(BOTH, STARTS, scheme, 2, UNITS, NO_CREASES, Blocks(1))
    alone = [
        by_kernels(part, 2, scheme=with_strength(scheme, strength), length=length)
        for part, length, strength in zip(PARTS, LENGTHS.tolist(), STRENGTHS, strict=True)
    ]
    assert made.reports == [part.reports for part in alone]
    assert made.multi_fan_vertices == [0, 1]
    corners = np.concatenate([part.points[part.faces] for part in alone])
    np.testing.assert_array_equal(made.points[made.faces], corners)
    gates = np.concatenate([part.gate[part.faces] for part in alone])
    np.testing.assert_array_equal(made.gate[made.faces], gates)
    np.testing.assert_array_equal(made.split_topology().vertex_count, len(BOTH.vertices) + 36)


def test_a_crease_across_parts_is_no_edge():
    with pytest.raises(ParameterError, match="creases"):
        refine_parts_fused(BOTH, STARTS, loop(), 1, UNITS, Creases(np.array([[0, 12]])), Blocks(1))
