"""Every experiment, in the order of the page."""

from collections.abc import Mapping
from types import MappingProxyType

from train.experiments import (
    ablation,
    c_sweep,
    capacity,
    headline,
    published,
    saddle,
    sphere_ridge,
)
from train.experiments.experiment import Experiment

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {
        module.EXPERIMENT.name: module.EXPERIMENT
        for module in (
            ablation,
            headline,
            c_sweep,
            capacity,
            saddle,
            sphere_ridge,
            published,
        )
    }
)
