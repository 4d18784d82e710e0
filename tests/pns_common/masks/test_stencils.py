"""Loop's weights against the spectrum of the subdivision matrix."""

import numpy as np
import pytest

from pns_common.masks.stencils import limit_ring_weight, loop_beta


def test_beta_is_the_cosine_formula_not_warrens():
    valence = np.arange(3, 13)
    expected = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / valence) / 4) ** 2) / valence
    np.testing.assert_allclose(loop_beta(valence), expected, rtol=1e-15)
    warren = np.where(valence == 3, 3 / 16, 3 / (8 * valence))
    assert (np.abs(loop_beta(valence) - warren) < 1e-12).tolist() == [
        k in (3, 6) for k in valence.tolist()
    ]


@pytest.mark.parametrize("valence", [3, 4, 6, 9])
def test_the_limit_mask_is_the_left_eigenvector_of_the_star(valence):
    beta = loop_beta(np.array([valence]))[0]
    star = np.zeros((1 + valence, 1 + valence))
    star[0], star[0, 0] = beta, 1 - valence * beta
    for j in range(valence):
        star[1 + j, [0, 1 + j]] = 3 / 8
        star[1 + j, [1 + (j - 1) % valence, 1 + (j + 1) % valence]] += 1 / 8
    values, vectors = np.linalg.eig(star.T)
    mask = np.real(vectors[:, np.abs(values - 1).argmin()])
    mask /= mask.sum()
    weight = limit_ring_weight(np.array([valence]))[0]
    np.testing.assert_allclose(mask, [1 - weight, *[weight / valence] * valence], atol=1e-14)


def test_a_vertex_without_neighbours_has_no_weights():
    assert not loop_beta(np.array([0])).any()
    assert not limit_ring_weight(np.array([0])).any()
