"""The bundled models beyond ridges: families trained on, and families never seen."""

from dataclasses import dataclass

from pns_common import loop
from train.data.datasets import Dataset
from train.data.stream import held_out_families, trained_families
from train.experiments.beyond.models import bundled_schemes, model_files
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.card import compare_with_loop
from train.metrics.whole_surface import gain, whole_surface

SHALLOW = 1


@dataclass(frozen=True, slots=True)
class Row:
    """One model on one family."""

    family: str = column("Family")
    seen: bool = column("In the stream")
    model: str = column("Model")
    inserted_percent: float = column("Inserted %", "+.1f")
    first_percent: float = column("Level 1 %", "+.1f")
    first_worst: float = column("Worst %", "+.1f")
    last_percent: float = column("Last level %", "+.1f")
    last_worst: float = column("Worst %", "+.1f")
    last_normal_percent: float = column("Shading %", "+.1f")


def run(laboratory: Laboratory) -> Outcome:
    """Measure every bundled model on every family."""
    levels, rows = laboratory.scale.levels, []
    most = laboratory.scale.instances
    families = [(family, True) for family in trained_families()[:most]]
    families += [(family, False) for family in held_out_families()[:most]]
    for number, (family, seen) in enumerate(families):
        laboratory.progress(f"families: {family.name}", number, len(families))
        data = Dataset(family.name, family.instances[:most])
        rows += _rows(data, levels, seen=seen)
    notes = (
        "Distances over Loop's: *inserted* is the published metric after one step, at the vertices "
        f"on edges; the others are all vertices after one level and after {levels}, with the worst "
        "instance of each family, and the mean angle of face normals to the surface's: plain "
        "ratios of means, not the bootstrap's. The column *in the stream* is about the models "
        "trained on random surfaces; `paper` and `signed` saw ridges alone.",
        "On saddles Loop's edge vertices are already right to 10⁻⁴ of the patch: there is nothing "
        "to gain, and a per cent is a millionth of the patch's size.",
    )
    return Outcome((table("families", "Families of surfaces", Row, rows),), notes=notes)


def _rows(data: Dataset, levels: int, *, seen: bool) -> list[Row]:
    reference = {level: whole_surface(loop(), data, level) for level in (SHALLOW, levels)}
    rows: list[Row] = []
    for name, scheme in bundled_schemes().items():
        first, last = (
            gain(whole_surface(scheme, data, level), reference[level])
            for level in (SHALLOW, levels)
        )
        inserted = compare_with_loop(scheme, data)["distance"].percent
        rows.append(
            Row(
                family=data.name,
                seen=seen,
                model=name,
                inserted_percent=inserted,
                first_percent=first.distance,
                first_worst=first.worst,
                last_percent=last.distance,
                last_worst=last.worst,
                last_normal_percent=last.normal,
            )
        )
    return rows


EXPERIMENT = Experiment(
    name="families",
    title="Families of surfaces",
    source="Beyond the paper.",
    run=run,
    seconds=60,
    reads=model_files,
)
