"""The levels of a refinement as topologies, with creases that wear off.

A crease of sharpness s is sharp for s levels; its decimal part mixes the sharp with the smooth rule
at the level where it ends (DeRose, Kass, Truong 1998). Blender's crease c is the sharpness 10 c²,
and 1 is sharp for good, as in its own Subdivision Surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.topology import Topology, halves_of
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes import BaseScheme
from pns_common.schemes.limit import limit_positions

from .snapshot import edge_keys

SHARPEST = 10.0


@dataclass(frozen=True, eq=False)
class Mixture:
    """A second reading of a level, with more sharp edges, and each new vertex's share of it."""

    topology: Topology
    creases: Int[np.ndarray, "N 2"]
    share: Float[np.ndarray, "W 1"]

    def of(self, smooth: Float[np.ndarray, "W K"], sharp: Float[np.ndarray, "W K"]) -> np.ndarray:
        """Smooth and sharp rows, mixed."""
        return smooth + self.share * (sharp - smooth)


@dataclass(frozen=True, eq=False)
class Step:
    """One level: its topology with the creases that are sharp throughout, and what is between.

    ``soft`` names further edges of the topology, each with its sharpness in this level's rules.
    """

    topology: Topology
    creases: Int[np.ndarray, "N 2"]
    soft: Creases
    mixture: Mixture | None


@dataclass(frozen=True, eq=False)
class Steps:
    """All levels, and what is left at the end: faces, and the sharpness of edges."""

    base: BaseScheme
    steps: tuple[Step, ...]
    final: Topology
    pairs: Int[np.ndarray, "N 2"]
    crease_sharpness: Float[np.ndarray, " N"]

    @cached_property
    def at_last(self) -> Topology:
        """The final topology with the creases that the last level kept sharp, for limits."""
        soft = _halves(self.steps[-1].soft, self.steps[-1].topology, self.base)
        return with_creases(soft.applied_by_name(self.final), self.last_creases)

    @cached_property
    def last_creases(self) -> Int[np.ndarray, "N 2"]:
        """The halves of the creases that the last level kept sharp."""
        last = self.steps[-1].topology
        return halves_of(last, last.crease_edges)

    @property
    def wears_off(self) -> bool:
        """True where some crease is not sharp for good."""
        first, last = self.steps[0], self.steps[-1]
        if any(step.mixture is not None or step.soft.named is not None for step in self.steps):
            return True
        return len(last.creases) != len(first.creases) * 2 ** (len(self.steps) - 1)


def crease_sharpness_of(crease: Float[np.ndarray, " E"]) -> Float[np.ndarray, " E"]:
    """Return Blender's crease, 0 … 1, as a number of levels."""
    return np.where(crease >= 1, np.inf, SHARPEST * np.clip(crease, 0, 1) ** 2)


def crease_of(crease_sharpness: Float[np.ndarray, " E"]) -> Float[np.ndarray, " E"]:
    """Return the crease that is sharp for so many levels."""
    return np.sqrt(np.clip(crease_sharpness / SHARPEST, 0, 1))


def level_steps(
    control: Topology,
    base: BaseScheme,
    levels: int,
    pairs: Int[np.ndarray, "N 2"],
    crease_sharpness: Float[np.ndarray, " N"],
    soft: Creases = NO_CREASES,
) -> Steps:
    """Return ``levels`` levels' topologies; ``control`` is the first, without creases.

    ``pairs`` of vertices name edges of this sharpness. ``soft`` names edges that blend sharp and
    smooth rules, at as many levels as it says.
    """
    steps = []
    kept = crease_sharpness > 0
    pairs, crease_sharpness = pairs[kept], crease_sharpness[kept]
    plain = control
    for depth in range(levels):
        sharp, soft = pairs[crease_sharpness >= 1], soft if soft.sharp_at(depth) else NO_CREASES
        topology = with_creases(soft.applied_by_name(plain), sharp)
        mixture = _mixture(plain, base, pairs, crease_sharpness, soft)
        steps.append(Step(topology, sharp, soft, mixture))
        soft = _halves(soft, plain, base)
        pairs, crease_sharpness = _worn(plain, pairs, crease_sharpness)
        plain = base.split(plain, Blocks())
    return Steps(base, tuple(steps), plain, pairs, crease_sharpness)


def refine_columns(
    columns: Float[np.ndarray, "V K"], steps: Steps, *, limit: bool = False
) -> Float[np.ndarray, "W K"]:
    """Refine columns by the scheme's masks, level by level; ``limit``: and its limit masks."""
    if columns.shape[1] == 0:
        return np.zeros((steps.final.vertex_count, 0))
    base, blocks = steps.base, Blocks(available_threads())
    for step in steps.steps:
        columns, given = base.place(columns, step.topology, blocks), columns
        if step.mixture is not None:
            sharp = base.place(given, step.mixture.topology, blocks)
            columns = step.mixture.of(columns, sharp)
    return limit_positions(columns, steps.at_last, blocks, base) if limit else columns


def edge_numbers(topology: Topology, pairs: Int[np.ndarray, "N 2"]) -> Int[np.ndarray, " N"]:
    """Return which edge of the topology each pair is; −1 where it is none."""
    if len(topology.edges) == 0 or len(pairs) == 0:
        return np.full(len(pairs), -1, dtype=np.int64)
    keys = edge_keys(topology.edges)
    order = np.argsort(keys)
    wanted = edge_keys(pairs)
    place = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)
    nearest = order[place]
    return np.where(keys[nearest] == wanted, nearest, -1)


def with_creases(topology: Topology, pairs: Int[np.ndarray, "N 2"]) -> Topology:
    """Return the topology with the edges that pairs of vertices name as creases."""
    return topology.with_creases(topology.rows_of(pairs)) if len(pairs) else topology


def _halves(soft: Creases, topology: Topology, base: BaseScheme) -> Creases:
    """Return the halves of edges that are named with their sharpness."""
    if soft.named is None or soft.sharpness is None:
        return NO_CREASES
    halves, corners = halves_of(topology, topology.rows_of(soft.named)), soft.soft_corners
    if corners is not None:
        new = len(topology.edges) + (topology.face_count if base.polygons else 0)
        corners = np.concatenate([corners, np.zeros(new)])
    chosen = {"named": halves, "sharpness": np.repeat(soft.sharpness, 2), "soft_corners": corners}
    return replace(soft, **chosen)


def _mixture(
    plain: Topology,
    base: BaseScheme,
    pairs: Int[np.ndarray, "N 2"],
    crease_sharpness: Float[np.ndarray, " N"],
    soft: Creases,
) -> Mixture | None:
    """Mix edges of less than a level left: sharp by that share, their ends by the mean.

    The vertex of a face takes the largest share of its edges.
    """
    ending = crease_sharpness < 1
    if not ending.any():
        return None
    edges, share = edge_numbers(plain, pairs[ending]), crease_sharpness[ending]
    at_edges = np.zeros(len(plain.edges))
    at_edges[edges] = share
    ends = pairs[ending].reshape(-1)
    total = np.bincount(ends, np.repeat(share, 2), plain.vertex_count)
    count = np.bincount(ends, minlength=plain.vertex_count)
    at_vertices = total / np.maximum(count, 1)
    topology = with_creases(soft.applied_by_name(plain), pairs)
    shares = [at_vertices, at_edges]
    if base.polygons:
        shares.append(np.maximum.reduceat(at_edges[plain.corner_edges], plain.offsets[:-1]))
    return Mixture(topology, pairs, np.concatenate(shares)[:, None])


def _worn(
    plain: Topology, pairs: Int[np.ndarray, "N 2"], crease_sharpness: Float[np.ndarray, " N"]
) -> tuple[Int[np.ndarray, "M 2"], Float[np.ndarray, " M"]]:
    """Return the halves of sharp edges, a level less sharp; without those that are smooth now."""
    lasting = crease_sharpness > 1
    edges = edge_numbers(plain, pairs[lasting])
    middle = plain.vertex_count + edges
    halves = np.stack([pairs[lasting], np.stack([middle, middle], axis=1)], axis=-1)
    return halves.reshape(-1, 2), np.repeat(crease_sharpness[lasting] - 1, 2)
