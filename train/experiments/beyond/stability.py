"""The bundled models on lifted stars: the Reif margin for every valence and lift."""

from collections.abc import Mapping
from functools import partial
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure as Drawing

from pns_common import load_model
from train.certificates.double_precision import double_model, read_bytes
from train.certificates.lifted_star import HIGHEST
from train.certificates.subject import subject_of_model
from train.experiments.beyond.models import bundled_schemes, model_files
from train.experiments.harness.experiment import Column, Experiment, Figure, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import panels, zero_line
from train.spectra.spectrum import VALENCES, Spectrum, follow_lift, loop_gap

LIFTS = tuple(np.linspace(0, HIGHEST, 5).tolist())
COLUMNS = (
    Column("model", "Model"),
    Column("valence", "k", "d"),
    Column("loop_gap", "Loop's gap", "+.4f"),
    *(Column(f"lift_{lift:.1f}", f"Lift {lift:.1f}", "+.4f") for lift in LIFTS[1:]),
    Column("largest", "Largest |λ|", ".3f"),
)
NOTES = (
    "The signed Reif margin of a star whose centre is lifted by so many spokes (spoke 0.25 R), the "
    "networks in double precision: the least |λ| of the six eigenvalues continued from Loop's "
    "tangent pair, less the largest of the rest. On the plane every model has Loop's gap, whatever "
    "its weights. A lifted star is no fixed point of subdivision: the margin is a diagnostic. "
    "`general` acts at the first level alone: its learned step is never repeated, and what follows "
    "has Loop's spectrum.",
)


def run(laboratory: Laboratory) -> Outcome:
    """Follow every bundled model's spectrum in the lift."""
    followed: dict[str, dict[int, list[Spectrum]]] = {}
    valences = VALENCES[: laboratory.scale.instances]
    names = list(bundled_schemes())[: laboratory.scale.instances]
    for number, name in enumerate(names):
        model = load_model(name)
        scheme = subject_of_model(model, double_model(model, read_bytes(name))).exact
        followed[name] = {}
        for valence in valences:
            done = number * len(valences) + len(followed[name])
            laboratory.progress(f"stars: {name}, k = {valence}", done, len(names) * len(valences))
            followed[name][valence] = follow_lift(scheme, valence, LIFTS)
    rows = tuple(
        (
            name,
            valence,
            loop_gap(valence),
            *(spectrum.margin for spectrum in spectra[1:]),
            max(spectrum.largest for spectrum in spectra),
        )
        for name, by_valence in followed.items()
        for valence, spectra in by_valence.items()
    )
    figure = Figure(
        "stability",
        f"The signed Reif margin at lift {HIGHEST:g} against the valence; the line is Loop's gap.",
        partial(_draw, followed),
    )
    return Outcome(
        (Table("stability", "Stars of the bundled models", COLUMNS, rows),), (figure,), NOTES
    )


def _draw(followed: Mapping[str, Mapping[int, list[Spectrum]]]) -> Drawing:
    figure, (axes,) = panels(1, height=2.6)
    for (name, by_valence), marker in zip(followed.items(), cycle("o^sdvP"), strict=False):
        margins = [spectra[-1].margin for spectra in by_valence.values()]
        axes.plot(list(by_valence), margins, marker=marker, label=name)
    valences = list(next(iter(followed.values())))
    axes.plot(valences, [loop_gap(k) for k in valences], color="0.3", linewidth=0.9, label="Loop")
    zero_line(axes)
    axes.set(xlabel="Valence k", ylabel="Signed Reif margin", xticks=valences)
    axes.legend()
    return figure


EXPERIMENT = Experiment(
    name="stability",
    title="Stars of the bundled models",
    source="Beyond the paper.",
    run=run,
    seconds=90,
    reads=model_files,
)
