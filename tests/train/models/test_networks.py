import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from pns_common.fused.kernels.smoothstep import smoothstep

from train.models.networks import ACTIVATIONS, BoundedNet, unit_correction


def network(seed=0, hidden=(8, 8), activation="gelu"):
    return BoundedNet(5, hidden, activation, torch.Generator().manual_seed(seed))


@given(
    seed=st.integers(0, 2**31),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    budget=st.floats(1e-6, 1e6),
    activation=st.sampled_from(sorted(ACTIVATIONS)),
)
def test_output_stays_in_the_ball_for_any_weights(seed, scale, budget, activation):
    net = network(seed, activation=activation).double()
    features = torch.from_numpy(np.random.default_rng(seed).normal(size=(64, 5)) * 10)
    with torch.no_grad():
        for layer in net.linear_layers:
            layer.weight *= scale
        lengths = torch.linalg.vector_norm(net(features, budget), dim=-1)
    assert (lengths <= budget * (1 + 1e-12)).all()


def test_short_outputs_are_only_scaled():
    net = network()
    features = torch.zeros(1, 5)
    z = net.net(features)
    assert torch.linalg.vector_norm(z) < 1
    torch.testing.assert_close(net(features, 0.25), 0.25 * z, rtol=0, atol=0)


def test_gelu_is_the_exact_one():
    x = torch.linspace(-6, 6, 101, dtype=torch.float64)
    expected = [0.5 * v * (1 + math.erf(v / math.sqrt(2))) for v in x.tolist()]
    np.testing.assert_allclose(ACTIVATIONS["gelu"]()(x), expected, rtol=0, atol=1e-15)


def test_the_smoothstep_is_the_kernels():
    x = torch.linspace(-3, 3, 101)
    made = ACTIVATIONS["smoothstep"]()(x).numpy()
    np.testing.assert_array_equal(made, [smoothstep(each) for each in x.numpy()])


def test_weights_come_from_the_given_generator_alone():
    torch.manual_seed(1)
    first, state = network(seed=5), torch.get_rng_state()
    torch.manual_seed(2)
    second = network(seed=5)
    for weight, again in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(weight, again)
    torch.manual_seed(1)
    assert torch.equal(torch.get_rng_state(), state)


def test_weights_keep_to_torchs_own_initial_range():
    for layer in network(hidden=(64,)).linear_layers:
        bound = layer.in_features**-0.5
        assert 0.9 * bound < layer.weight.abs().max() <= bound
        assert layer.bias.abs().max() <= bound


@pytest.mark.parametrize("own", [torch.float32, torch.float64])
def test_the_operator_gets_its_own_precision_back(own):
    net = network().to(own)
    features = torch.rand(4, 5, dtype=torch.float64)
    correction = unit_correction(net)(features)
    assert correction.dtype == torch.float64
    torch.testing.assert_close(correction, net(features.to(own), 1.0).double(), rtol=0, atol=0)
