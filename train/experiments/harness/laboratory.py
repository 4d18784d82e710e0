"""The laboratory of experiments: their scale, the data sets, trained networks."""

import hashlib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import msgspec

from pns_common import Scheme, pns
from train.data.datasets import DATASETS, Dataset
from train.experiments.harness.variants import PNS, Variant, fit_variant
from train.fitting.determinism import machine_fingerprint
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.networks import BoundedNet
from train.models.recipe import Recipe
from train.models.torch_model import recipe_model

ROOT = Path(__file__).resolve().parents[3]


@cache
def code() -> bytes:
    """Return a hash of all code that a result may depend on."""
    digest = hashlib.sha256()
    for package in ("pns_common", "train"):
        for path in sorted((ROOT / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.digest()


@dataclass(frozen=True, slots=True)
class Scale:
    """The amount of an experiment that is run.

    Attributes:
        name: on the page, where it is not the whole.
        instances: at most, of whatever there are several: surfaces, meshes, valences, values. Of a
            data set two at least, as intervals need them.
        training_steps: at most.
        levels: of repeated subdivision.
        samples: random draws where an experiment takes any.
    """

    name: str
    instances: int
    training_steps: int
    levels: int
    samples: int


FULL = Scale("full", instances=1000, training_steps=100_000, levels=4, samples=1000)
# A few seconds each, for the tests: every line runs, no number means anything.
SMALL = Scale("small", instances=1, training_steps=2, levels=2, samples=10)


@dataclass(frozen=True)
class Laboratory:
    """Everything that an experiment may use.

    Attributes:
        checkpoints: folder of networks to take as they are, by recipe name; what is missing there
            is trained.
        cache: folder where trained networks are kept between runs.
        published: folder of the author's published data, or None.
    """

    scale: Scale
    cache: Path
    checkpoints: Path | None
    published: Path | None

    def dataset(self, name: str) -> Dataset:
        """Return a data set, cut to the scale."""
        dataset = DATASETS[name]()
        return Dataset(dataset.name, dataset.instances[: max(2, self.scale.instances)])

    def scheme(self, recipe: Recipe) -> Scheme:
        """Return PNS with the network of a recipe."""
        return pns(recipe_model(recipe, self.network(recipe)), recipe.budget)

    def network(self, recipe: Recipe, variant: Variant = PNS) -> BoundedNet:
        """Return the network of a recipe: given, kept from an earlier run, or trained now."""
        if self.checkpoints is not None:
            given = self.checkpoints / f"{recipe.name}.safetensors"
            if given.is_file():
                return load_checkpoint(given).network
        recipe = replace(recipe, steps=min(recipe.steps, self.scale.training_steps))
        kept = self.cache / f"{recipe.name}-{_digest(recipe, variant)}.safetensors"
        if kept.is_file():
            return load_checkpoint(kept).network
        fitted = fit_variant(variant, recipe)
        save_checkpoint(kept, Checkpoint(recipe, fitted.network, {}, machine_fingerprint()))
        return fitted.network


def _digest(recipe: Recipe, variant: Variant) -> str:
    """Return a short hash of what decides the weights: the recipe, the rule, the code."""
    parts = [msgspec.json.encode(recipe), variant.name.encode(), code()]
    return hashlib.sha256(b"\n".join(parts)).hexdigest()[:12]
