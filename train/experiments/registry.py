"""Every experiment, in the order of the page."""

from collections.abc import Mapping
from types import MappingProxyType

from train.experiments.beyond import (
    fairness,
    fresh_ridges,
    models,
    shading,
    spheres,
    validation,
    whole_meshes,
)
from train.experiments.harness.experiment import Experiment
from train.experiments.paper import (
    ablation,
    budget,
    c_sweep,
    capacity,
    cross_section,
    extended,
    headline,
    hero,
    published,
    repeated,
    saddle,
    spectral,
    sphere_ridge,
    structural,
)

ORDERED: tuple[Experiment, ...] = (
    structural.EXPERIMENT,
    spectral.EXPERIMENT,
    ablation.EXPERIMENT,
    headline.EXPERIMENT,
    cross_section.EXPERIMENT,
    repeated.EXPERIMENT,
    c_sweep.EXPERIMENT,
    budget.EXPERIMENT,
    capacity.EXPERIMENT,
    saddle.EXPERIMENT,
    sphere_ridge.EXPERIMENT,
    hero.EXPERIMENT,
    extended.EXPERIMENT,
    models.EXPERIMENT,
    validation.EXPERIMENT,
    whole_meshes.EXPERIMENT,
    spheres.EXPERIMENT,
    fresh_ridges.EXPERIMENT,
    fairness.EXPERIMENT,
    shading.EXPERIMENT,
    published.EXPERIMENT,
)

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {experiment.name: experiment for experiment in ORDERED}
)
