"""Held-out evaluation: any scheme on any data set, against Loop."""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

from pns_common import Scheme, loop
from train.connectivity import connect
from train.data.datasets import Dataset, Instance
from train.metrics.one_step import METRICS, Errors, Improvement, improvement, one_step_errors
from train.refining import AnyScheme, Method, Smooth, refine

# For each metric its value on every instance of a data set.
ErrorTable = Mapping[str, Float[np.ndarray, " N"]]


# A scheme for each instance: for what may look at the surface, as the envelope's limit does.
SchemeOf = Callable[[Instance], AnyScheme]


def one_step_table(scheme: AnyScheme | SchemeOf, dataset: Dataset) -> ErrorTable:
    """Refine every instance by one step in the paper's units and measure it."""
    choose = (lambda _: scheme) if isinstance(scheme, Scheme | Method | Smooth) else scheme
    rows = [_instance_errors(choose(instance), instance) for instance in dataset.instances]
    return {metric: np.array([getattr(row, metric) for row in rows]) for metric in METRICS}


def compare_with_loop(scheme: AnyScheme | SchemeOf, dataset: Dataset) -> dict[str, Improvement]:
    """Return the paired improvement of a scheme over Loop for each metric."""
    reference, method = one_step_table(loop(), dataset), one_step_table(scheme, dataset)
    return {metric: improvement(reference[metric], method[metric]) for metric in METRICS}


def _instance_errors(scheme: AnyScheme, instance: Instance) -> Errors:
    mesh = instance.mesh
    refined = refine(mesh, scheme, levels=1, reference_length=1.0).mesh
    level = connect(mesh.faces, len(mesh.vertices))
    inserted = refined.vertices[level.vertex_count + level.interior.numpy()]
    return one_step_errors(instance.surface, mesh.vertices, level, inserted)
