import pytest
import safetensors.torch
import torch

from pns_common import ModelError
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.from_recipe import initial_network
from train.models.recipes import paper, paper_text


def checkpoint(recipe):
    return Checkpoint(recipe, initial_network(recipe), {"set": {"percent": 1.5}}, "machine")


@pytest.mark.parametrize("recipe", [paper(7), paper_text(1)], ids=lambda recipe: recipe.name)
def test_round_trip_keeps_everything(tmp_path, recipe):
    path, written = tmp_path / "deep" / "one.safetensors", checkpoint(recipe)
    save_checkpoint(path, written)
    read = load_checkpoint(path)
    assert (read.recipe, read.metrics, read.machine) == (recipe, written.metrics, "machine")
    for name, tensor in written.network.state_dict().items():
        assert torch.equal(read.network.state_dict()[name], tensor)
    assert [entry.name for entry in path.parent.iterdir()] == ["one.safetensors"]


def test_same_checkpoint_same_bytes(tmp_path):
    for name in ("one", "two"):
        save_checkpoint(tmp_path / name, checkpoint(paper()))
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ModelError, match="no such file") as caught:
        load_checkpoint(tmp_path / "absent.safetensors")
    assert caught.value.path.endswith("absent.safetensors")


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "x"
    torch.save(initial_network(paper()).state_dict(), path)
    with pytest.raises(ModelError, match="safetensors with a recipe"):
        load_checkpoint(path)
    safetensors.torch.save_file({"net.0.weight": torch.zeros(1)}, path)
    with pytest.raises(ModelError, match="safetensors with a recipe"):
        load_checkpoint(path)
    safetensors.torch.save_file({"x": torch.zeros(1)}, path, {"pns": '{"recipe": 3}'})
    with pytest.raises(ModelError, match="safetensors with a recipe"):
        load_checkpoint(path)
