"""Every experiment, in the order of the page."""

from collections.abc import Mapping
from types import MappingProxyType

from train.experiments import (
    ablation,
    both_rules,
    budget,
    c_sweep,
    cad,
    capacity,
    cross_section,
    decimation,
    extended,
    families,
    features,
    headline,
    hero,
    lifted_stars,
    models,
    published,
    repeated,
    saddle,
    spectral,
    sphere_ridge,
    stability,
    structural,
    trade,
)
from train.experiments.experiment import Experiment

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {
        module.EXPERIMENT.name: module.EXPERIMENT
        for module in (
            structural,
            spectral,
            ablation,
            headline,
            cross_section,
            repeated,
            c_sweep,
            budget,
            capacity,
            saddle,
            sphere_ridge,
            features,
            hero,
            extended,
            lifted_stars,
            cad,
            models,
            families,
            both_rules,
            stability,
            trade,
            decimation,
            published,
        )
    }
)
