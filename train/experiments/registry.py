"""Every experiment, in the order of the page."""

from collections.abc import Mapping
from types import MappingProxyType

from train.experiments import headline
from train.experiments.experiment import Experiment

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {one.name: one for one in (headline.EXPERIMENT,)}
)
