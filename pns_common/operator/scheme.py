"""A scheme: a base scheme, and the learned rule that adds to it at the first levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pkgutil import resolve_name
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Integer

from pns_common.errors import MeshError, ModelError, ParameterError
from pns_common.mesh.creases import NO_CREASES, Creases, chosen_creases
from pns_common.mesh.mesh import Mesh
from pns_common.model.card import PAPER_FORMAT
from pns_common.model.features import FEATURE_SETS
from pns_common.model.file import COMPANIONS, companion_of, load_model
from pns_common.model.session import Model, heads_of, networks
from pns_common.operator.directed import DirectedNetworks
from pns_common.operator.formula import Additions, DirectedRule, PaperRule
from pns_common.operator.level import Level
from pns_common.parallel import Blocks
from pns_common.parameters import is_number
from pns_common.scheme_names import BASE_SCHEMES
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.catmull_clark import CATMULL_CLARK
from pns_common.schemes.loop import LOOP
from pns_common.schemes.matrix import subdivision_matrix

BASES: dict[str, BaseScheme] = {name: resolve_name(place) for name, place in BASE_SCHEMES.items()}
NAMES = (*BASES, "pns")


@dataclass(frozen=True)
class Scheme:
    """A refinement rule.

    Attributes:
        name: its name in reports.
        base: the linear scheme.
        rule: what is added at learned levels; None: nothing.
        learned_levels: at so many levels the rule acts, then the base scheme alone. None: at all.
        creases: the edges that ``creases="auto"`` keeps sharp.
        for_polygons: makes the scheme that takes over on meshes with other faces than triangles,
            where the base scheme has none for them; None: no scheme.
        budget, model, model_hash: for reports; None without a model.
    """

    name: str
    base: BaseScheme = field(default=LOOP, repr=False)
    rule: Callable[[Level], Additions] | None = field(default=None, repr=False)
    learned_levels: int | None = 0
    creases: Creases = field(default=NO_CREASES, repr=False)
    for_polygons: Callable[[], Scheme] | None = field(default=None, repr=False)
    budget: float | None = None
    model: str | None = None
    model_hash: str | None = field(default=None, repr=False)

    def acts_at(self, depth: int) -> bool:
        """Return whether the rule acts at a level; level 0 refines the control mesh."""
        if self.rule is None:
            return False
        return self.learned_levels is None or depth < self.learned_levels

    def matrix(
        self,
        mesh: Mesh,
        levels: int = 1,
        creases: Integer[np.ndarray, "N 2"] | Creases | Literal["auto"] | None = "auto",
    ) -> Any:
        """Return the base scheme's subdivision matrix S, (W, V), as a ``scipy.sparse.csr_array``.

        S @ columns are the columns of the refined vertices: S @ mesh.vertices is where ``refine``
        puts them without a learned rule, to rounding. Rows are > 0 and sum to 1.

        Args:
            mesh: the control mesh.
            levels: number of steps, at least 1.
            creases: edges to keep sharp, as for ``refine``.

        Raises:
            ParameterError: a crease is no edge.
            MeshError: the mesh has polygons, and the scheme refines triangles alone.
            ImportError: scipy is not installed.
        """
        if not (mesh.triangles or self.base.polygons):
            if self.for_polygons is None:
                raise MeshError("polygons, expected triangles", element="faces")
            return self.for_polygons().matrix(mesh, levels, creases)
        try:
            sparse = import_module("scipy.sparse")
        except ImportError as error:
            raise ImportError("a scheme's matrix needs scipy: pip install scipy") from error
        kept = chosen_creases(creases, self.creases)
        topologies = [kept.applied(mesh.vertices, mesh.topology())]
        for depth in range(1, levels):
            sharp = kept.sharp_at(depth)
            topologies.append(self.base.split(topologies[-1], Blocks(), inherit=sharp))
        made = subdivision_matrix(topologies, self.base)
        return sparse.csr_array((made.weights, made.columns, made.starts), shape=made.shape)


def loop() -> Scheme:
    """Return the scheme of Loop subdivision (Loop 1987).

    Example:
        >>> loop().base.name
        'loop'
    """
    return Scheme("loop")


def catmull_clark() -> Scheme:
    """Return the scheme of Catmull–Clark subdivision (Catmull and Clark 1978).

    Example:
        >>> catmull_clark().base.polygons
        True
    """
    return Scheme("catmull-clark", CATMULL_CLARK)


def named_scheme(name: str) -> Scheme:
    """Return a scheme by its name: a base scheme's, or "pns", that of the default model.

    Raises:
        ParameterError: there is no such scheme.
    """
    if name == "pns":
        return pns(load_model())
    if name not in BASES:
        raise ParameterError("scheme", name, expected=f"one of {', '.join(NAMES)}")
    return Scheme(name, BASES[name])


def pns(model: Model, budget: float | None = None) -> Scheme:
    """Return the scheme of Proximity-Preserving Neural Subdivision with a model.

    Args:
        model: from ``load_model``, or any object that keeps the Model protocol.
        budget: C ≥ 0, dimensionless; None takes the one that the model was trained at. With 0 the
            scheme is the base scheme, bit for bit.

    Raises:
        ParameterError: the budget is negative or not finite, or this is no model.
        ModelError: the card names a base scheme that is not known here.

    Example:
        >>> pns(load_model()).learned_levels
        1
    """
    if not isinstance(model, Model):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ParameterError("model", type(model), expected="a model, as load_model() gives it")
    card = model.card
    companion = partial(_of_companion, model, budget) if model.name in COMPANIONS else None
    budget = card.budget if budget is None else budget
    if not (is_number(budget) and budget >= 0):
        raise ParameterError("budget", budget, expected="a finite number ≥ 0")
    budget = float(budget)
    named: dict[str, Any] = {"budget": budget, "model": model.name, "model_hash": model.hash}
    if card.format == PAPER_FORMAT:
        network = partial(_run, model, networks(card)[0].given)
        seen, symmetric = FEATURE_SETS[card.features], card.orientation == "symmetric"
        kind = getattr(model, "feature_type", np.float64)
        rule = PaperRule(network, seen, symmetric, card.gate_sharpness, budget, kind)
        return Scheme("pns", rule=rule, learned_levels=None, **named)
    if card.base not in BASES:
        raise ModelError(model.name, expected=f"a base of {sorted(BASES)}", found=repr(card.base))
    levels = int(_given(model, "sharpness_levels"))
    return Scheme(
        "pns",
        BASES[card.base],
        _directed_rule(model, budget),
        learned_levels=1,
        creases=Creases(learned=True, levels=levels) if budget > 0 and levels else NO_CREASES,
        for_polygons=companion,
        **named,
    )


def _directed_rule(model: Model, budget: float) -> DirectedRule:
    """Return the rule of a model of directed edges."""
    card = model.card
    encoder, *rounds, heads = (partial(_run, model, each.given) for each in networks(card))
    pairs = tuple(zip(rounds[::2], rounds[1::2], strict=True))
    sizes = int(_given(model, "width")), int(_given(model, "hidden")), heads_of(card)
    kind = getattr(model, "feature_type", np.float64)
    return DirectedRule(
        DirectedNetworks(encoder, pairs, heads, *sizes, kind),
        card.gate_sharpness,
        _given(model, "vertex_gate_sharpness"),
        budget,
        _given(model, "boundary_strength"),
        _given(model, "network_scale"),
        _given(model, "fold_angle"),
    )


# Functions of the module, so that a scheme can be sent to another process. At unit budget, scaled
# in float64 afterwards, so that one file serves every C / R exactly.


def _run(model: Model, given: str, rows: Float[np.ndarray, "N K"]) -> Float[np.ndarray, "N A"]:
    return model.run(given, rows)


def _of_companion(model: Model, budget: float | None) -> Scheme:
    return pns(companion_of(model), budget)


def _given(model: Model, name: str) -> float:
    """Return a number of a card of format 5. Raises ModelError if the card has none."""
    value = getattr(model.card, name)
    if value is None:
        raise ModelError(model.name, expected=f"{name} on a card of format 5", found="none")
    return float(value)
