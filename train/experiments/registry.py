"""Every experiment, in the order of the page."""

from collections.abc import Mapping

from train.experiments.harness.experiment import Experiment
from train.experiments.paper import (
    ablation,
    budget,
    c_sweep,
    capacity,
    cross_section,
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
    published.EXPERIMENT,
)

EXPERIMENTS: Mapping[str, Experiment] = {experiment.name: experiment for experiment in ORDERED}
