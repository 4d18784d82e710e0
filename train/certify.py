"""Certify a model or any scheme: every certificate, as data, as a table and as JSON."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.table import Table

from pns_common.errors import ModelError, PnsError
from pns_common.onnx_model import DEFAULT_MODEL, load_model
from train.certificates.affine import affine_reproduction
from train.certificates.bodies import Body, flat_bodies, synthetic_bodies
from train.certificates.certificate import Certificate
from train.certificates.displacement import bounded_displacement
from train.certificates.double_precision import double_model, read_bytes
from train.certificates.equivariance import equivariance
from train.certificates.lifted_star import lifted_stars
from train.certificates.model_file import keeps_its_word
from train.certificates.planar_spectrum import planar_spectrum
from train.certificates.regular import regular_smoothness
from train.certificates.scaling import normal_variation_slope, proximity_slope
from train.certificates.stability import lipschitz_slope
from train.certificates.subject import Subject, subject_of_model
from train.spectrum import VALENCES

OnProgress = Callable[[str, int, int], None]
"""Called with what comes next, how many steps are done, and of how many."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """All certificates of one subject.

    Attributes:
        facts: what was certified: the model's hash, the budget, the meshes.
    """

    name: str
    facts: dict[str, Any]
    certificates: tuple[Certificate, ...]

    @property
    def passed(self) -> bool:
        """Whether everything that counts has passed."""
        return all(one.passed for one in self.certificates if one.counts)


@dataclass(frozen=True, slots=True)
class Step:
    """One piece of a certification: its theorem and title, should it fail to run, and the work."""

    theorem: str
    title: str
    work: Callable[[], Certificate | list[Certificate]]


def certify_model_file(
    source: str | Path | None,
    real: Sequence[Body],
    seed: int,
    on_progress: OnProgress,
    valences: Sequence[int] = VALENCES,
) -> Verdict:
    """Certify a model file, also one that someone else made.

    Args:
        source: a file, a bundled name, or None for the default.
        real: meshes beside the synthetic ones.
        valences: of the stars.
    """
    source = DEFAULT_MODEL if source is None else source
    facts: dict[str, Any] = {"source": str(source)}
    try:
        model = load_model(source)
        subject = subject_of_model(model, double_model(model, read_bytes(source)))
    except ModelError as error:
        return Verdict(str(source), facts, (refused("file", "the file keeps the contract", error),))
    facts |= {"sha256": model.hash, "budget": subject.budget, "meshes": [one.name for one in real]}
    word = Step("file", "the file keeps its word", lambda: keeps_its_word(model))
    found = run_steps([word, *scheme_steps(subject, real, seed, valences)], on_progress)
    return Verdict(model.name, facts, found)


def certify_scheme(
    subject: Subject,
    real: Sequence[Body],
    seed: int,
    on_progress: OnProgress,
    valences: Sequence[int] = VALENCES,
) -> Verdict:
    """Certify any scheme against T1–T8 and the lifted stars."""
    found = run_steps(scheme_steps(subject, real, seed, valences), on_progress)
    return Verdict(subject.name, {"budget": subject.budget}, found)


def scheme_steps(
    subject: Subject, real: Sequence[Body], seed: int, valences: Sequence[int]
) -> list[Step]:
    """The certificates of a scheme, ready to run."""
    shaped, flat = synthetic_bodies(seed), flat_bodies(seed)
    every = (*shaped, *real)
    return [
        Step("T1", "bounded displacement", lambda: bounded_displacement(subject, every)),
        Step("T2", "equivariance", lambda: equivariance(subject, every, seed)),
        Step("T3", "affine reproduction", lambda: affine_reproduction(subject, flat, seed)),
        Step("T4", "proximity slope", lambda: proximity_slope(subject, every)),
        Step("T5", "regular regions", lambda: regular_smoothness(subject, seed)),
        Step("T6", "normal-variation slope", lambda: normal_variation_slope(subject, shaped)),
        Step("T7", "Lipschitz slope", lambda: lipschitz_slope(subject, shaped, seed)),
        Step("T8", "planar spectrum", lambda: planar_spectrum(subject, valences)),
        Step("stars", "lifted stars", lambda: lifted_stars(subject, valences)),
    ]


def run_steps(steps: Sequence[Step], on_progress: OnProgress) -> tuple[Certificate, ...]:
    """Run steps in order; one that the operator refuses to finish fails by its name."""
    found: list[Certificate] = []
    for number, one in enumerate(steps):
        on_progress(one.title, number, len(steps))
        try:
            made = one.work()
        except PnsError as error:
            made = refused(one.theorem, one.title, error)
        found += [made] if isinstance(made, Certificate) else made
    on_progress("done", len(steps), len(steps))
    return tuple(found)


def refused(theorem: str, title: str, error: PnsError) -> Certificate:
    """A certificate that could not be measured, and so has failed."""
    return Certificate(theorem, title, math.nan, where=str(error))


def verdict_json(verdict: Verdict) -> bytes:
    """A verdict as JSON; numbers that JSON does not know (NaN, ∞) are null."""
    rows = [
        {
            "theorem": one.theorem,
            "name": one.name,
            "kind": str(one.kind),
            "value": _number(one.value),
            "low": _number(one.low),
            "high": _number(one.high),
            "passed": one.passed,
            "where": one.where,
        }
        for one in verdict.certificates
    ]
    facts = {"name": verdict.name, **verdict.facts, "passed": verdict.passed}
    return msgspec.json.format(msgspec.json.encode({**facts, "certificates": rows})) + b"\n"


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file in one piece: a reader sees the old one or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_bytes(data)
    temporary.replace(path)


def verdict_table(verdict: Verdict) -> Table:
    """One row a certificate."""
    table = Table(title=f"Certificates of {verdict.name}", title_justify="left")
    for heading in ("", "Property"):
        table.add_column(heading, no_wrap=heading == "")
    for heading in ("Value", "Bound"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("")
    for row in _rows(verdict):
        table.add_row(*row)
    return table


def _rows(verdict: Verdict) -> Iterator[tuple[str, ...]]:
    for one in verdict.certificates:
        colour = "green" if one.passed else "red" if one.counts else "yellow"
        word = "pass" if one.passed else "fail"
        kind = "" if one.kind == "certificate" else f" ({one.kind})"
        name = f"{one.name}\n[dim]{_escaped(one.where)}[/dim]" if one.where else one.name
        yield one.theorem, name, f"{one.value:.6g}", one.bound, f"[{colour}]{word}[/]{kind}"


def _escaped(text: str) -> str:
    # rich reads square brackets as markup.
    return text.replace("[", "\\[")


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
