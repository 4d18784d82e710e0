from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch

from pns_common import ModelError
from train.models.published import load_published, network_from_state


def state(widths=(5, 8, 8, 3), seed=0):
    rng = np.random.default_rng(seed)
    tensors = {}
    for layer, (fan_in, fan_out) in enumerate(pairwise(widths)):
        for name, shape in (("weight", (fan_out, fan_in)), ("bias", (fan_out,))):
            values = rng.standard_normal(shape).astype(np.float32)
            tensors[f"net.{2 * layer}.{name}"] = torch.from_numpy(values)
    return tensors


def same(network, expected):
    return all(value.equal(expected[name]) for name, value in network.state_dict().items())


def test_an_archive_and_a_clone_give_the_same_networks(tmp_path):
    expected = {"pns_a_C0.25": state(seed=1), "unconstrained": state((12, 8, 3), seed=2)}
    archive, clone = tmp_path / "archive", tmp_path / "clone" / "results" / "weights"
    archive.mkdir()
    clone.mkdir(parents=True)
    arrays = {f"{c}/{k}": v.numpy() for c, s in expected.items() for k, v in s.items()}
    np.savez(archive / "weights.npz", **arrays)
    torch.save(expected["pns_a_C0.25"], clone / "pns_a_C0.25.pt")
    nested = {f"model.{name}": value for name, value in expected["unconstrained"].items()}
    torch.save({"state_dict": nested, "C": 0.5}, clone / "unconstrained.pt")
    for folder in (archive, tmp_path / "clone"):
        networks = load_published(folder)
        assert set(networks) == set(expected)
        for name, network in networks.items():
            assert same(network, expected[name])


class Evil:
    def __reduce__(self):
        return Path.touch, (Path("pickled-code-ran"),)


def test_pickled_code_is_refused_and_never_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    torch.save({"net.0.weight": Evil()}, tmp_path / "evil.pt")
    with pytest.raises(ModelError, match="weights only"):
        load_published(tmp_path)
    assert not Path("pickled-code-ran").exists()


@pytest.mark.parametrize("content", [[1, 2], {"epoch": 3}])
def test_files_without_weights_are_named(tmp_path, content):
    torch.save(content, tmp_path / "other.pt")
    with pytest.raises(ModelError, match=r"other\.pt"):
        load_published(tmp_path)


def test_an_empty_folder_and_broken_states_are_refused(tmp_path):
    with pytest.raises(ModelError, match="neither"):
        load_published(tmp_path)
    with pytest.raises(ModelError, match="state dictionary"):
        network_from_state("no weights", {})
    broken = state()
    broken["net.2.weight"] = torch.zeros(3, 3)
    with pytest.raises(ModelError, match="state dictionary"):
        network_from_state("shapes", broken)
