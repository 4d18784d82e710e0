"""Off the plane: tangent-eigenvalue drift and Reif margin of lifted k-stars, k = 3 … 12."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from matplotlib.figure import Figure as Drawing

from train.certificates.planar_spectrum import HIGHEST, LIFTS
from train.certificates.subject import subject_of_network
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import COLOURS, panels, zero_line
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.spectra.spectrum import VALENCES, Spectrum, follow_lift, loop_eigenvalue, loop_gap

BUDGETS = (0.1, 0.25, 0.5, 1.0)
# Valences in the figure, with colour and marker.
SHOWN: Mapping[int, tuple[str, str]] = MappingProxyType(
    {
        3: (COLOURS["unconstrained"], "o"),
        4: (COLOURS["butterfly"], "^"),
        6: (COLOURS["loop"], "s"),
        8: (COLOURS["pns"], "d"),
        12: (COLOURS["normal-displacement"], "v"),
    }
)

NOTES = (
    "The star is embedded in regular rings so that every footprint is complete; spoke 0.25 R, the "
    "centre lifted by so many spokes. The margin is the least |λ| of the six eigenvalues continued "
    "in the lift from Loop's tangent pair (double, once a coordinate), less the largest of the "
    "rest but the three translations. Loop's own is the same at every lift. A lifted star is no "
    "fixed point of subdivision: a negative margin is a warning, not a proof of lost smoothness.",
    "One network, trained at C = 0.5, is run at every C.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One star at one budget and lift."""

    valence: int = column("k", "d")
    budget: float = column("C", "g")
    lift: float = column("Lift", ".2f")
    tangent: float = column("Least tangent |λ|", ".5f")
    drift: float = column("Drift from Loop's", "+.5f")
    third: float = column("Largest other |λ|", ".5f")
    margin: float = column("Margin", "+.5f")
    loop_gap: float = column("Loop's gap", ".5f")
    stable: bool = column("All |λ| < 1")


def run(laboratory: Laboratory) -> Outcome:
    """Follow the spectrum of the trained operator in the lift, for every valence and budget."""
    recipe = paper()
    model = recipe_model(recipe, laboratory.network(recipe))
    valences = VALENCES[: laboratory.scale.instances]
    followed: dict[tuple[int, float], list[Spectrum]] = {}
    cases = [(valence, budget) for valence in valences for budget in BUDGETS]
    for done, (valence, budget) in enumerate(cases):
        laboratory.progress(f"lifted stars, k = {valence}, C = {budget:g}", done, len(cases))
        scheme = subject_of_network(model, budget).exact
        followed[valence, budget] = follow_lift(scheme, valence, LIFTS)
    rows = (
        lifted_star_row(valence, budget, lift, spectrum)
        for (valence, budget), spectra in followed.items()
        for lift, spectrum in zip(LIFTS, spectra, strict=True)
    )
    return Outcome(
        tables=(table("lifted_stars", "Spectra of lifted stars", Row, rows),),
        figures=(
            Figure(
                "lifted_stars",
                f"The signed Reif margin of lifted stars. Left: against the lift, at C = 0.5. "
                f"Right: against C, at lift {HIGHEST:g}.",
                lambda: _draw(followed),
            ),
        ),
        notes=NOTES,
    )


def lifted_star_row(valence: int, budget: float, lift: float, spectrum: Spectrum) -> Row:
    """Return one row of the table: tangents, their drift, the margin."""
    size = np.abs(spectrum.values)
    tangent = float(size[spectrum.least_tangent])
    return Row(
        valence=valence,
        budget=budget,
        lift=lift,
        tangent=tangent,
        drift=tangent - loop_eigenvalue(valence),
        third=float(size[spectrum.largest_other]),
        margin=spectrum.margin,
        loop_gap=loop_gap(valence),
        stable=spectrum.largest < 1,
    )


def _draw(followed: Mapping[tuple[int, float], list[Spectrum]]) -> Drawing:
    figure, (by_lift, by_budget) = panels(2, height=2.6)
    for valence, (colour, marker) in SHOWN.items():
        if (valence, BUDGETS[0]) not in followed:
            continue
        style = {"color": colour, "marker": marker, "label": f"k = {valence}"}
        by_lift.plot(LIFTS, [spectrum.margin for spectrum in followed[valence, 0.5]], **style)
        by_budget.plot(BUDGETS, [followed[valence, c][-1].margin for c in BUDGETS], **style)
    for axes in (by_lift, by_budget):
        zero_line(axes)
    by_lift.set(xlabel="Lift of the centre (spokes)", ylabel="Signed Reif margin", title="C = 0.5")
    by_budget.set(xlabel="Budget C", title=f"Lift {HIGHEST:g}")
    by_lift.legend()
    return figure


EXPERIMENT = Experiment(
    name="lifted-stars",
    title="Lifted stars",
    source="Beyond the paper: named there as open.",
    run=run,
    seconds=60,
)
