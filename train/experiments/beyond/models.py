"""Loop, the bundled models and the unconstrained network: accuracy, stability, guarantees."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure as Drawing

from pns_common import loop, pns
from pns_common.model.file import BUNDLED, DEFAULT_MODEL, bundled_models, load_model
from train.data.datasets import Dataset
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import COLOURS, panels
from train.experiments.paper.methods import unconstrained_scheme
from train.metrics.card import compare_with_loop
from train.metrics.whole_surface import WholeSurface, gain, surface_jump, whole_surface
from train.refining import AnyScheme

# Times Loop's: the jump that is asked for where the surface itself has no larger one.
JUMP_LIMIT = 1.5


@dataclass(frozen=True, slots=True)
class Row:
    """One method on the held-out ridges."""

    method: str = column("Method")
    near_percent: float = column("Near %", "+.1f")
    global_percent: float = column("All %", "+.1f")
    hausdorff_percent: float = column("Hausdorff %", "+.1f")
    normal_near_percent: float = column("Normals near %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    whole_percent: float = column("Whole surface %", "+.1f")
    shading_percent: float = column("Shading %", "+.1f")
    jump: float = column("Largest jump", ".3f")
    jump_to_loop: float = column("Jump / Loop's", ".2f")
    jump_to_allowed: float = column("Worst jump / allowed", ".2f")
    max_ratio: float = column("Max ratio", ".4g")
    flipped: int = column("Flipped", "d")


def model_files(_: Laboratory) -> Iterable[Path]:
    """Return the bundled model files: what an experiment that measures them reads."""
    return [Path(str(BUNDLED / f"{name}.onnx")) for name in bundled_models()]


def models_and_assets(laboratory: Laboratory) -> Iterable[Path]:
    """Return these and all files of the folder of meshes."""
    folder = () if laboratory.assets is None else laboratory.assets.rglob("*")
    return [*model_files(laboratory), *(path for path in folder if path.is_file())]


def bundled_schemes() -> dict[str, AnyScheme]:
    """Return PNS with every bundled model, the default last, as the product runs them."""
    names = sorted(bundled_models(), key=lambda name: (name == DEFAULT_MODEL, name))
    return {name: pns(load_model(name)) for name in names}


def run(laboratory: Laboratory) -> Outcome:
    """Measure all on the held-out ridges: one step, and the whole surface after four."""
    held_out, levels = laboratory.dataset("ridge-held-out"), laboratory.scale.levels
    schemes = {
        "Loop": loop(),
        **{f"`{name}`": scheme for name, scheme in bundled_schemes().items()},
        "Unconstrained": unconstrained_scheme(laboratory),
    }
    surface = np.array([surface_jump(instance, levels) for instance in held_out.instances])
    reference, rows, after = whole_surface(loop(), held_out, levels), [], {}
    for number, (name, scheme) in enumerate(schemes.items()):
        laboratory.progress(f"models: {name}", number, len(schemes))
        after[name] = whole_surface(scheme, held_out, levels)
        rows.append(_row(name, scheme, held_out, after[name], reference, surface))
    notes = (
        "*Near*, *all*, *Hausdorff* and *normals* are the published one-step metrics: improvement "
        f"over Loop at the vertices inserted on edges. The rest is the whole mesh after {levels} "
        "levels: the distance of all vertices, *shading* the mean angle between a face's normal "
        "and the surface's at the nearest point, the largest angle between neighbouring faces; "
        "these are plain ratios of means, not the bootstrap's, and of jumps the ratio of the "
        "largest of all ridges. "
        f"*Allowed* is {JUMP_LIMIT:g} times Loop's jump, or the jump of Loop's own mesh once it is "
        "laid onto the surface where that is more; the column is the worst ridge's.",
        "The product's own files are measured, each with its own C and c; "
        "docs/reference/models.md says how they were made.",
    )
    return Outcome(
        tables=(table("models", "Held-out ridges", Row, rows),),
        figures=(
            Figure(
                "models",
                f"The held-out ridges after {levels} levels, one dot a ridge. Left: distance of "
                "all vertices over Loop's. Right: the largest jump between neighbouring faces "
                "over Loop's; the crosses are the surface's own.",
                lambda: _draw(after, reference, surface),
            ),
        ),
        notes=notes,
    )


def _row(
    name: str,
    scheme: AnyScheme,
    held_out: Dataset,
    after: WholeSurface,
    reference: WholeSurface,
    surface: np.ndarray,
) -> Row:
    step = compare_with_loop(scheme, held_out)
    whole = gain(after, reference)
    allowed = np.maximum(JUMP_LIMIT * reference.jump, surface)
    return Row(
        method=name,
        near_percent=step["distance_near"].percent,
        global_percent=step["distance"].percent,
        hausdorff_percent=step["hausdorff"].percent,
        normal_near_percent=step["normal_near"].percent,
        normal_percent=step["normal"].percent,
        whole_percent=whole.distance,
        shading_percent=whole.normal,
        jump=float(after.jump.max()),
        jump_to_loop=float(after.jump.max() / reference.jump.max()),
        jump_to_allowed=float((after.jump / allowed).max()),
        max_ratio=float(after.ratio.max()),
        flipped=int(after.flipped.sum()),
    )


def _draw(
    after: Mapping[str, WholeSurface], reference: WholeSurface, surface: np.ndarray
) -> Drawing:
    figure, (distance, jump) = panels(2, height=2.6)
    jump.set_yscale("log")
    shown = [name for name in after if name not in ("Loop", "Unconstrained")]
    for place, name in enumerate(shown):
        whole = after[name]
        spread = place + np.linspace(-0.2, 0.2, len(whole.distance))
        distance.scatter(spread, whole.distance / reference.distance, s=12, color=COLOURS["pns"])
        jump.scatter(spread, whole.jump / reference.jump, s=12, color=COLOURS["pns"])
        jump.scatter(spread, surface / reference.jump, s=10, color="0.5", marker="x", linewidth=0.7)
    for axes in (distance, jump):
        axes.axhline(1, color=COLOURS["loop"], linewidth=1)
        axes.set_xticks(range(len(shown)), [name.strip("`") for name in shown])
        axes.set_xlim(-0.5, len(shown) - 0.5)
    jump.axhline(JUMP_LIMIT, color="0.3", linewidth=0.8, linestyle="--")
    distance.set(title="Distance over Loop's", ylim=(0, None))
    jump.set(title="Largest jump over Loop's")
    return figure


EXPERIMENT = Experiment(
    name="models",
    title="The bundled models",
    source="Beyond the paper.",
    run=run,
    seconds=60,
    reads=model_files,
)
