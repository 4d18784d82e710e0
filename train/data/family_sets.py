"""Test sets of every family: new draws of those in the stream, and the families held out of it."""

import numpy as np

from pns_common import Mesh
from train.data.datasets import Dataset, Instance, saddle_held_out, sphere_ridge_held_out
from train.data.grid import grid_faces, jittered_grid
from train.data.patches import JITTER, rounded_boxes, tori
from train.data.stream import FAMILIES, Family, crossing

COUNT = 10
# No stream starts from it: streams are seeded by recipes, from 0.
TEST_SEED = 9999

# Families of the paper, which have test sets of their own.
DRAWN_ELSEWHERE = ("ridge", "saddle")


def trained_families() -> list[Dataset]:
    """Return test sets of the families that are in the stream, but for ridges."""
    drawn = [
        family_set(name, family) for name, family in FAMILIES.items() if name not in DRAWN_ELSEWHERE
    ]
    return [saddle_held_out(), *drawn]


def held_out_families() -> list[Dataset]:
    """Return test sets of the families that no stream holds."""
    crossings = family_set("crossing", crossing)
    return [sphere_ridge_held_out(), crossings, tori(), rounded_boxes()]


def family_set(name: str, family: Family) -> Dataset:
    """Return draws of a family, each on the paper's 9 × 9 patch."""
    rng = np.random.default_rng(TEST_SEED)
    instances = []
    for index in range(COUNT):
        drawn = family(rng)
        plane = jittered_grid(TEST_SEED + index, JITTER).double().numpy()
        instances.append(Instance(drawn.surface, Mesh(drawn.lift(plane), grid_faces())))
    return Dataset(f"{name}-held-out", tuple(instances))
