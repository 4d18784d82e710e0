"""The structural tables: T1–T8 for several weights and with parts removed, and adversaries."""

import copy
from dataclasses import dataclass

import numpy as np
import torch

from train.certificates.adversary import (
    Attack,
    affine_attack,
    equivariance_attack,
    proximity_attack,
)
from train.certificates.affine import TURNED
from train.certificates.bodies import random_motion
from train.certificates.certify import run_steps, scheme_steps
from train.certificates.subject import Certificate, Subject, in_double, subject_of_network
from train.experiments.harness.experiment import (
    Cell,
    Column,
    Experiment,
    Outcome,
    Table,
    column,
    table,
)
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.variants import VARIANTS, variant_recipe, variant_scheme
from train.experiments.paper.ablation import REMOVED_TITLES
from train.experiments.paper.paper_values import PUBLISHED_ADVERSARIAL, PUBLISHED_STRUCTURAL
from train.models.from_recipe import initial_network
from train.models.networks import BoundedNet
from train.models.recipe import Recipe
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.spectra.spectrum import VALENCES

SEED = 0
# Random weights this much larger: steeper than any that training gives.
SCALED = 5.0

ATTACK_STEPS = 200

REMOVED_COLUMNS = (
    Column("variant", "Variant"),
    *(Column(f"t{number}", f"T{number}") for number in range(1, 9)),
    Column("failed", "Failed"),
)
NOTES = (
    "Displacements are recomputed from output positions and a Loop step written independently of "
    "the operator. Proximity ratios are a share of C h², so T1 reaches 1 where weights and mesh "
    "use the whole envelope; the published 0.0736 is that of an untrained network. The row "
    "*as it runs* is a share of the envelope: the network reads single precision. T5 and T7 are "
    "measured: no theorem bounds those numbers.",
    "The adversaries climb over weights and mesh together, in double precision. The one of "
    "proximity finds the cap and never passes it; edges that the search folds until their frame "
    "falls back to the fixed triad are left out of equivariance, as the theorem leaves them out.",
    "**Where this differs from the paper.** The Lipschitz slope is taken over moves from 1e-2 to "
    "1e-7, where it is nearer to 1 than the paper's 1.02.",
)


@dataclass(frozen=True, slots=True)
class CertificateRow:
    """One certificate of all subjects."""

    theorem: str = column("Theorem")
    property: str = column("Property")
    kind: str = column("Kind")
    bound: str = column("Bound")
    trained: float = column("Trained", ".4g")
    random: float = column("Random", ".4g")
    random_steep: float = column("Random × 5", ".4g")
    adversarial: float = column("Adversarial", ".4g")
    all_passed: bool = column("All pass")
    published: float | None = column("Published", ".4g")
    paper: float | None = column("Paper", ".4g")


@dataclass(frozen=True, slots=True)
class AttackRow:
    """One adversary."""

    attack: str = column("Adversary")
    first: float = column("At first", ".3g")
    worst: float = column("Worst found", ".15g")
    cap: float = column("Cap", ".3g")
    held: bool = column("Held")
    steps: int = column("Steps")
    published: float | None = column("Published", ".3g")


def run(laboratory: Laboratory) -> Outcome:
    """Certify four sets of weights and four operators that lack a part; run the adversaries."""
    recipe = paper(SEED)
    attacks = run_attacks(recipe, laboratory)
    networks = {
        "trained": laboratory.network(recipe),
        "random": initial_network(recipe),
        "random × 5": scaled(initial_network(recipe), SCALED),
        "adversarial": attacks[0].network.float(),
    }
    subjects = [
        subject_of_network(recipe_model(recipe, net), recipe.budget) for net in networks.values()
    ]
    certified = [certify(subject, laboratory) for subject in subjects]
    removed = [
        (name, certify(lacking(name, laboratory), laboratory))
        for name in list(REMOVED_TITLES)[: laboratory.scale.instances]
    ]
    return Outcome(
        tables=(
            table(
                "structural",
                "Certificates T1–T8",
                CertificateRow,
                (certificate_row(row) for row in zip(*certified, strict=True)),
            ),
            Table(
                "structural_removed",
                "Which certificate fails when a part is removed",
                REMOVED_COLUMNS,
                tuple(_removed_row(name, certificates) for name, certificates in removed),
            ),
            table(
                "structural_adversarial",
                "Adversaries over weights and mesh",
                AttackRow,
                map(attack_row, attacks),
            ),
        ),
        notes=NOTES,
    )


def run_attacks(recipe: Recipe, laboratory: Laboratory) -> list[Attack]:
    """Run the adversaries of what is promised; the first is the one of proximity."""
    steps = min(ATTACK_STEPS, laboratory.scale.training_steps)
    turn, _ = random_motion(np.random.default_rng(SEED))
    return [
        proximity_attack(recipe, steps),
        equivariance_attack(recipe, steps),
        affine_attack(recipe, np.eye(3), 0.0, steps),
        affine_attack(recipe, turn, TURNED, steps),
    ]


def certify(subject: Subject, laboratory: Laboratory) -> tuple[Certificate, ...]:
    """Certify T1–T8; lifted stars have an experiment of their own."""
    valences = VALENCES[: laboratory.scale.instances]
    steps = [step for step in scheme_steps(subject, (), SEED, valences) if step.theorem != "stars"]
    return run_steps(steps, lambda title, done, of: None)


def lacking(name: str, laboratory: Laboratory) -> Subject:
    """Return the operator without one of its parts, trained."""
    recipe = variant_recipe(paper(SEED), VARIANTS[name])
    return variant_subject(name, laboratory.network(recipe, VARIANTS[name]), recipe)


def variant_subject(name: str, network: BoundedNet, recipe: Recipe) -> Subject:
    """Return a variant of the operator with a network of its recipe."""
    single, double = (
        variant_scheme(VARIANTS[name], exact, recipe) for exact in (network, in_double(network))
    )
    return Subject(name, single, double, recipe.budget)


def scaled(network: BoundedNet, factor: float) -> BoundedNet:
    """Return the network with all weights times a factor."""
    larger = copy.deepcopy(network)
    with torch.no_grad():
        for weight in larger.parameters():
            weight *= factor
    return larger


def certificate_row(certificates: tuple[Certificate, ...]) -> CertificateRow:
    """Return the row of one certificate, of the subjects in the order of the columns."""
    trained, random, steep, adversarial = certificates
    published, paper = PUBLISHED_STRUCTURAL.get(trained.name, (None, None))
    return CertificateRow(
        theorem=trained.theorem,
        property=trained.name,
        kind=str(trained.kind),
        bound=trained.bound,
        trained=trained.value,
        random=random.value,
        random_steep=steep.value,
        adversarial=adversarial.value,
        all_passed=all(certificate.passed for certificate in certificates),
        published=published,
        paper=paper,
    )


def _removed_row(name: str, certificates: tuple[Certificate, ...]) -> tuple[Cell, ...]:
    failed = [certificate for certificate in certificates if not certificate.passed]
    theorems = {certificate.theorem for certificate in failed}
    marks = ("fail" if f"T{number}" in theorems else "pass" for number in range(1, 9))
    return (REMOVED_TITLES[name], *marks, "; ".join(certificate.name for certificate in failed))


def attack_row(attack: Attack) -> AttackRow:
    """Return the row of one adversary."""
    turned = attack.cap == TURNED
    return AttackRow(
        attack=f"{attack.name}, any plane" if turned else attack.name,
        first=attack.values[0],
        worst=attack.worst,
        cap=attack.cap,
        held=attack.held,
        steps=len(attack.values),
        published=None if turned else PUBLISHED_ADVERSARIAL[attack.name],
    )


EXPERIMENT = Experiment(
    name="structural",
    title="Structural certification",
    source="Paper: the table of structural tests, and the adversarial searches.",
    run=run,
    seconds=120,
)
