"""Certify a model or any scheme: every certificate, as data, as a table and as JSON."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.markup import escape
from rich.table import Table

from pns_common import ModelError, ParameterError, PnsError
from pns_common.model.card import DIRECTED_FORMAT
from pns_common.model.file import DEFAULT_MODEL, load_model
from train.certificates.affine import affine_reproduction
from train.certificates.bases import LOOP
from train.certificates.bodies import Bodies, Body, polygon_bodies, triangle_bodies
from train.certificates.displacement import AT_MOST, bounded_displacement
from train.certificates.double_precision import double_model, read_bytes
from train.certificates.equivariance import equivariance
from train.certificates.learned_once import (
    fold_free,
    limit_distance,
    locality,
    neighbour_turns,
    numbering,
    resolution_independence,
    smoothness_class,
)
from train.certificates.model_file import keeps_its_word
from train.certificates.planar_spectrum import lifted_stars, planar_spectrum
from train.certificates.scaling import (
    lipschitz_slope,
    normal_variation_slope,
    proximity,
    proximity_ratio,
    proximity_slope,
    regular_smoothness,
)
from train.certificates.subject import (
    Certificate,
    Kind,
    Subject,
    in_words,
    subject_of_model,
)
from train.spectra.spectrum import VALENCES

# Called with what comes next, how many steps are done, and of how many.
OnProgress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class OwnMesh:
    """A mesh that was given.

    Attributes:
        proximity: its `proximity_ratio`, at most 1 by T4; NaN where it was skipped.
        skipped: why it was, in words; empty where it was not.
    """

    name: str
    faces: int
    proximity: float
    skipped: str = ""

    @property
    def passed(self) -> bool:
        """True where T4 holds on it."""
        return self.proximity <= AT_MOST

    @property
    def failed(self) -> bool:
        """True where it does not."""
        return not (self.skipped or self.passed)


@dataclass(frozen=True, slots=True)
class Verdict:
    """All certificates of one subject.

    Attributes:
        facts: what was certified: the model's hash and the budget.
        own: meshes that were given.
        own_in: the theorems that they took part in.
    """

    name: str
    facts: dict[str, Any]
    certificates: tuple[Certificate, ...]
    own: tuple[OwnMesh, ...] = ()
    own_in: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """True where everything that counts has passed."""
        certified = (each.passed for each in self.certificates if each.counts)
        return all(certified) and not any(own.failed for own in self.own)

    @property
    def is_model(self) -> bool:
        """False where the file is no model, of which nothing can be certified."""
        return "sha256" in self.facts


@dataclass(frozen=True, slots=True)
class Step:
    """One piece of a certification: its theorem and title, should it fail to run, and the work.

    Attributes:
        own: whether meshes that are given take part.
    """

    theorem: str
    title: str
    work: Callable[[], Certificate | list[Certificate]]
    own: bool = False


def certify_model_file(
    source: str | Path | None,
    real: Sequence[Body],
    seed: int,
    on_progress: OnProgress,
    valences: Sequence[int] = VALENCES,
    only: Sequence[str] = (),
) -> Verdict:
    """Certify a model file, also one that someone else made.

    Args:
        source: a file, a bundled name, or None for the default.
        real: meshes beside the synthetic ones; polygons are skipped where the base is Loop.
        valences: of the stars.
        only: theorems, as "T4"; empty for all.

    Raises:
        ParameterError: one of those is none.
    """
    source = DEFAULT_MODEL if source is None else source
    facts: dict[str, Any] = {"source": str(source)}
    try:
        model = load_model(source)
        subject = subject_of_model(model, double_model(model, read_bytes(source)))
    except ModelError as error:
        return Verdict(str(source), facts, (refused("file", "the file keeps the contract", error),))
    facts |= {"sha256": model.hash, "budget": subject.budget}
    kept = [body for body in real if body.mesh.triangles or subject.base is not LOOP]
    bodies = [*(triangle_bodies if subject.base is LOOP else polygon_bodies)(seed).shaped, *kept]
    made = [
        Step("file", "the file keeps its word", lambda: keeps_its_word(model)),
        Step("T4", "proximity", lambda: proximity(subject, bodies), own=True),
        *scheme_steps(subject, kept, seed, valences),
    ]
    known = sorted({step.theorem for step in made})
    for name in only:
        if name not in known:
            raise ParameterError("only", name, expected=f"one of {', '.join(known)}")
    steps = sorted((s for s in made if not only or s.theorem in only), key=lambda s: s.theorem)
    own = tuple(_own(subject, body, skipped=body not in kept) for body in real)
    own_in = tuple(dict.fromkeys(step.theorem for step in steps if step.own))
    return Verdict(model.name, facts, run_steps(steps, on_progress), own, own_in)


def _own(subject: Subject, body: Body, *, skipped: bool) -> OwnMesh:
    count = body.mesh.face_count
    if skipped:
        return OwnMesh(body.name, count, math.nan, "has polygons; this model refines triangles")
    try:
        return OwnMesh(body.name, count, proximity_ratio(subject, body.mesh))
    except PnsError as error:
        return OwnMesh(body.name, count, math.nan, str(error))


def scheme_steps(
    subject: Subject, real: Sequence[Body], seed: int, valences: Sequence[int]
) -> list[Step]:
    """Return the certificates of a scheme, ready to run."""
    bodies = triangle_bodies(seed) if subject.base is LOOP else polygon_bodies(seed)
    every = (*bodies.shaped, *real)
    shaped = bodies.shaped
    return [
        Step(
            "T1",
            "bounded displacement",
            lambda: bounded_displacement(subject, every, seed=seed),
            own=True,
        ),
        Step("T2", "equivariance", lambda: equivariance(subject, every, seed), own=True),
        Step("T3", "affine reproduction", lambda: affine_reproduction(subject, bodies.flat, seed)),
        Step("T4", "proximity slope", lambda: proximity_slope(subject, every), own=True),
        Step("T5", "regular regions", lambda: regular_smoothness(subject, bodies.regular)),
        Step("T6", "normal-variation slope", lambda: normal_variation_slope(subject, shaped)),
        Step("T7", "Lipschitz slope", lambda: lipschitz_slope(subject, shaped, seed)),
        Step("T8", "planar spectrum", lambda: planar_spectrum(subject, valences)),
        *_steps_of_kind(subject, every, bodies, seed, valences),
    ]


def _steps_of_kind(
    subject: Subject, every: Sequence[Body], bodies: Bodies, seed: int, valences: Sequence[int]
) -> list[Step]:
    """Return the certificates that a kind of scheme has.

    Schemes that turn into their base have its spectra; of others lifted stars say more.
    """
    if subject.learned_once is None:
        return [Step("stars", "lifted stars", lambda: lifted_stars(subject, valences))]
    rough, shaped = (*every, bodies.rough), bodies.shaped
    messages = subject.learned_once.format == DIRECTED_FORMAT
    return [
        Step("folds", "fold-free", lambda: fold_free(subject, rough, seed), own=True),
        Step(
            "turns", "turns of neighbours", lambda: neighbour_turns(subject, rough, seed), own=True
        ),
        Step("limit", "limit distance", lambda: limit_distance(subject, rough, seed), own=True),
        Step("class", "smoothness class", lambda: smoothness_class(subject, [bodies.coarse])),
        Step(
            "scale",
            "resolution independence",
            lambda: resolution_independence(subject, every),
            own=True,
        ),
        Step("numbers", "numbering", lambda: numbering(subject, every, seed), own=True),
        *([Step("rings", "locality", lambda: locality(subject, shaped, seed))] * messages),
    ]


def run_steps(steps: Sequence[Step], on_progress: OnProgress) -> tuple[Certificate, ...]:
    """Run steps in order; one that the operator refuses to finish fails by its name."""
    certificates: list[Certificate] = []
    for number, step in enumerate(steps):
        on_progress(step.title, number, len(steps))
        try:
            made = step.work()
        except PnsError as error:
            made = refused(step.theorem, step.title, error)
        certificates += [made] if isinstance(made, Certificate) else made
    on_progress("done", len(steps), len(steps))
    return tuple(certificates)


def refused(theorem: str, title: str, error: PnsError) -> Certificate:
    """Return a certificate that could not be measured, and so has failed."""
    return Certificate(theorem, title, math.nan, where=str(error))


def verdict_json(verdict: Verdict) -> bytes:
    """Return a verdict as JSON; numbers that JSON does not know (NaN, ∞) are null."""
    rows = [
        {
            "theorem": certificate.theorem,
            "name": certificate.name,
            "kind": str(certificate.kind),
            "value": _number(certificate.value),
            "low": _number(certificate.low),
            "high": _number(certificate.high),
            "passed": certificate.passed,
            "where": certificate.where,
        }
        for certificate in verdict.certificates
    ]
    meshes = [
        {
            "name": own.name,
            "faces": own.faces,
            "proximity": _number(own.proximity),
            "skipped": own.skipped or None,
        }
        for own in verdict.own
    ]
    facts = {"name": verdict.name, **verdict.facts, "meshes": meshes, "passed": verdict.passed}
    return msgspec.json.format(msgspec.json.encode({**facts, "certificates": rows})) + b"\n"


def verdict_table(verdict: Verdict) -> Table:
    """Return the verdict as a table, one row a certificate."""
    table = Table(title=f"Certificates of {escape(verdict.name)}", title_justify="left")
    for heading in ("", "Property"):
        table.add_column(heading, no_wrap=heading == "")
    for heading in ("Value", "Bound"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("")
    for row in _rows(verdict):
        table.add_row(*row)
    return table


def own_table(verdict: Verdict) -> Table:
    """Return T4 on each mesh that was given, one row a mesh."""
    table = Table(
        title="Your meshes: theorem 4, the largest |S_θ − S| over C h² / R",
        caption=f"They took part in {', '.join(verdict.own_in)}." if verdict.own_in else None,
        title_justify="left",
        caption_justify="left",
    )
    table.add_column("Mesh", overflow="fold")
    for heading in ("Faces", "Value", "Bound"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("")
    for own in verdict.own:
        word = "[green]pass[/]" if own.passed else "[red]fail[/]"
        values = in_words(own.proximity), f"≤ {in_words(AT_MOST)}", word
        if own.skipped:
            values = "", "", f"skipped: {escape(own.skipped)}"
        table.add_row(escape(own.name), f"{own.faces:,}", *values)
    return table


def _rows(verdict: Verdict) -> Iterator[tuple[str, ...]]:
    for certificate in verdict.certificates:
        colour, word = ("green", "pass") if certificate.passed else ("red", "fail")
        kind = " (measured)" if certificate.kind is Kind.MEASURED else ""
        if certificate.kind is Kind.DIAGNOSTIC:
            colour, word = "dim", "for comparison"
        name = (
            f"{certificate.name}\n[dim]{escape(certificate.where)}[/dim]"
            if certificate.where
            else certificate.name
        )
        yield (
            certificate.theorem,
            name,
            in_words(certificate.value),
            certificate.bound if certificate.counts else "none",
            f"[{colour}]{word}[/]{kind}",
        )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
