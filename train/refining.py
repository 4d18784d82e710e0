"""Refine by the library's schemes, or by a rule of our own: baselines, ablations, controls.

A rule is a function from a level's points and connectivity to a `Step`. Both kinds of scheme give
the same numbers here, so that experiments need not tell them apart.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import Mesh, Scheme, load_model, loop, sharp_edges
from pns_common import refine as refine_by_library
from pns_common.mesh.reference_length import measure_reference_length
from train.connectivity import Connectivity, connect
from train.loop_masks import limit_mask, loop_mask
from train.reference import Step, Surroundings
from train.tensors import dot, root

# Points of a level, its connectivity, and R.
Rule = Callable[[Float[Tensor, "V 3"], Connectivity, float], Step]
Creases = Int[np.ndarray, "N 2"] | Literal["auto"] | None


@dataclass(frozen=True)
class Method:
    """A scheme of our own.

    Attributes:
        learned_levels: after these it is Loop; None: never.
        keeps_creases: whether it keeps the creases that the library finds.
    """

    name: str
    rule: Rule
    learned_levels: int | None = None
    keeps_creases: bool = False


@dataclass(frozen=True)
class Smooth:
    """A scheme of the library that keeps no creases."""

    scheme: Scheme

    @property
    def name(self) -> str:
        """The scheme's name."""
        return self.scheme.name


AnyScheme = Scheme | Method | Smooth


@dataclass(frozen=True, slots=True)
class LevelFigures:
    """Figures of a step, from the refinement's report.

    Attributes:
        ratio: largest proximity ratio, of edge and of old vertices.
        normal_jump: largest angle between neighbouring faces, radians.
        flipped: faces that oppose their Loop counterpart.
    """

    faces: int
    ratio: float
    normal_jump: float
    flipped: int


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined mesh, figures of each level, and ratio and gate of the last level's vertices."""

    mesh: Mesh
    levels: tuple[LevelFigures, ...]
    ratio: Float[np.ndarray, " W"]
    gate: Float[np.ndarray, " W"]


def refine(
    mesh: Mesh,
    scheme: AnyScheme,
    levels: int = 1,
    reference_length: float | Literal["auto"] = "auto",
    *,
    limit: bool = False,
    creases: Creases = "auto",
) -> Refined:
    """Refine a mesh on one thread.

    Args:
        mesh: the control mesh.
        scheme: the library's, or one of our own.
        levels: number of steps.
        reference_length: R.
        limit: put the vertices on Loop's limit surface in the end.
        creases: pairs of vertices, sharp for good; "auto": those that the scheme finds, if any.
    """
    if isinstance(scheme, Method):
        length = reference_length
        if length == "auto":
            length = measure_reference_length(mesh.vertices, mesh.faces.reshape(-1))
        sharp_levels: int | None = None
        if isinstance(creases, str):
            creases, sharp_levels = found_creases(mesh) if scheme.keeps_creases else (None, None)
        steps = _Steps(scheme, float(length), creases, sharp_levels)
        with torch.no_grad():
            return steps.refine(mesh, levels, limit=limit)
    if isinstance(scheme, Smooth):
        scheme, creases = scheme.scheme, None if creases == "auto" else creases
    made = refine_by_library(
        mesh, scheme, levels, reference_length, limit=limit, creases=creases, threads=1
    )
    figures = tuple(_figures(level) for level in made.report["levels"])
    return Refined(made.mesh, figures, made.ratio, made.gate)


def found_creases(mesh: Mesh) -> tuple[Int[np.ndarray, "N 2"] | None, int | None]:
    """Return the creases that the default model keeps on a mesh, and at how many levels."""
    return sharp_edges(mesh), load_model().card.sharpness_levels


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps of a method at a reference length, with creases that are sharp at some levels."""

    method: Method
    length: float
    creases: Int[np.ndarray, "N 2"] | None
    sharp_levels: int | None

    def refine(self, mesh: Mesh, levels: int, *, limit: bool) -> Refined:
        points, figures = torch.tensor(mesh.vertices), list[LevelFigures]()
        level = connect(mesh.faces, len(mesh.vertices), self.creases)
        step = loop_rule(points, level, self.length)
        for depth in range(levels):
            step = self._rule_at(depth)(points, level, self.length)
            is_sharp = self.sharp_levels is None or depth + 1 < self.sharp_levels
            halves = crease_children(level) if is_sharp else None
            after = connect(level.split().numpy(), len(step.base), halves)
            before, made = Surroundings(after, step.base), Surroundings(after, step.points)
            opposed = int((dot(before.normals, made.normals) < 0).sum())
            ratio = float(step.ratio.max())
            figures.append(LevelFigures(len(after.faces), ratio, largest_turn(made), opposed))
            points, level = step.points, after
        points = limit_mask(level)(points) if limit else points
        refined = Mesh(points.numpy(), level.faces.numpy())
        return Refined(refined, tuple(figures), step.ratio.numpy(), step.gate.numpy())

    def _rule_at(self, depth: int) -> Rule:
        learned = self.method.learned_levels
        acts = (learned is None or depth < learned) and self.length > 0
        return self.method.rule if acts else loop_rule


def loop_rule(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
    """Take a step of Loop."""
    base = loop_mask(mesh)(points)
    none = torch.zeros(len(base), dtype=torch.float64)
    return Step(base, torch.zeros_like(base), none, none, none + 1)


def loop_like(scheme: AnyScheme) -> AnyScheme:
    """Return Loop by the code that runs a scheme, with its rounding: the library's, or ours."""
    return Method("loop", loop_rule) if isinstance(scheme, Method) else loop()


def crease_children(mesh: Connectivity) -> Int[np.ndarray, "N 2"]:
    """Return the halves of all creases, as pairs of vertices of the split mesh."""
    rows = torch.nonzero(mesh.paired & (mesh.sharpness >= 1))
    halves = torch.stack([mesh.edges[rows[:, 0]], (mesh.vertex_count + rows).expand(-1, 2)], dim=2)
    return halves.reshape(-1, 2).numpy()


def largest_turn(around: Surroundings) -> float:
    """Return the largest angle between faces that share an interior edge, radians.

    Faces without area have no normal, and turn from none.
    """
    left, right = around.normals[around.mesh.half_edges[around.mesh.interior] // 3].unbind(dim=1)
    both = (dot(left, left) > 0) & (dot(right, right) > 0)
    chord = float(root(dot(left - right, left - right))[both].amax()) if both.any() else 0.0
    return float(2 * np.arcsin(min(1.0, chord / 2)))


def _figures(level: Mapping[str, Any]) -> LevelFigures:
    ratio = level["proximity_ratio"]["max"]
    if "vertex_rule" in level:
        ratio = max(ratio, level["vertex_rule"]["proximity_ratio"]["max"])
    return LevelFigures(level["faces"], ratio, level["normal_jump_max"], level["flipped_faces"])
