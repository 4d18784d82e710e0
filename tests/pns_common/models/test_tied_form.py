"""Dividing out the group: characters are orthogonal, sums and differences know one each."""

import numpy as np
import pytest

from pns_common.models.tied_form import character_table, feature_basis, tied_form
from pns_common.runtimes.tied_network.perceptron import Layer
from tests.support.tied import EDGES, GROUPS, act, tied_layers


@pytest.mark.parametrize("size", [1, 2, 4, 8])
def test_characters_are_signs_by_shared_bits_and_orthogonal(size):
    table = character_table(size)
    for s in range(size):
        for g in range(size):
            assert table[s, g] == (-1) ** bin(s & g).count("1")
    np.testing.assert_array_equal(table @ table.T, size * np.eye(size))


@pytest.mark.parametrize("name", GROUPS)
def test_each_sum_or_difference_only_changes_its_sign(name):
    group = GROUPS[name]
    pairs, characters, basis = feature_basis(group)
    table = character_table(len(group.order))
    rows = np.random.default_rng(0).standard_normal((5, group.order.shape[1]))
    for g in range(len(group.order)):
        signs = table[characters, g]
        np.testing.assert_allclose(
            act(group, g, rows) @ basis.T, rows @ basis.T * signs, atol=1e-14
        )
    # What the pairs say, one after the other, is what the basis is of the features.
    seen = rows.T.copy()
    for i, j in pairs:
        seen[i], seen[j] = seen[i] + seen[j], seen[i] - seen[j]
    np.testing.assert_allclose(seen.T, rows @ basis.T, atol=1e-14)


def test_a_form_holds_a_copy_of_each_unit_and_no_more():
    layers = [Layer(*layer) for layer in tied_layers(EDGES, (3, 5))]
    form = tied_form(layers, EDGES)
    assert (form.copies, form.widths.tolist()) == (8, [3, 5])
    assert (form.first.shape, form.hidden.shape, form.last.shape) == ((3, 18), (8 * 5 * 3,), (3, 5))
    np.testing.assert_array_equal(
        form.biases, np.concatenate([layers[0].bias[:3], layers[1].bias[:5]])
    )


def test_a_network_of_one_layer_or_of_no_symmetry_is_not_tied():
    layers = [Layer(*layer) for layer in tied_layers(EDGES, (3,))]
    assert tied_form(layers[:1], EDGES) is None
    rng = np.random.default_rng(0)
    other = Layer(rng.standard_normal(layers[0].weight.shape), layers[0].bias)
    assert tied_form([other, layers[1]], EDGES) is None
