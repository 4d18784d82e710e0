"""The structural tables for both learned rules: T1–T8 and adversaries with the vertex rule on."""

import copy

from pns_common.onnx_model import load_model
from train.certificates.double_precision import double_model, read_bytes
from train.certificates.subject import Subject, subject_of_model, subject_of_network
from train.experiments.experiment import Experiment, Outcome, Table
from train.experiments.laboratory import Laboratory
from train.experiments.models import model_files
from train.experiments.structural import (
    ATTACK_COLUMNS,
    CERTIFICATE_COLUMNS,
    SCALED,
    SEED,
    attack_row,
    certificate_row,
    certify,
    run_attacks,
    scaled,
)
from train.networks import BoundedNet
from train.recipe_operator import initial_network, initial_vertex_network
from train.recipes import Recipe, full
from train.torch_model import recipe_model

WITHOUT_PUBLISHED = -2
"""The last columns of the tables are the author's."""

NOTES = (
    "The tables of *Structural certification* for the model `full`, whose vertex rule moves old "
    "vertices: *trained* is the bundled file as the product runs it, the others are networks of "
    "its recipe. Vertices and edges count alike: displacements are recomputed from positions, each "
    "against its own envelope, C h² of the edge or of the ring.",
    "T5 is measured and no theorem's. Weights that spend the whole envelope at random turn faces "
    "of this coarse torus over at the first level, and a fold stays a fold; trained ones do not.",
    "Far from the plane nothing is promised; how the eigenvalues of lifted stars move is in "
    "*Stars of the bundled models*.",
)


def run(laboratory: Laboratory) -> Outcome:
    """Certify four sets of weights of both networks; run the adversaries over both."""
    recipe = full(SEED)
    attacks = run_attacks(recipe, laboratory)
    network, vertex_network = initial_network(recipe), initial_vertex_network(recipe)
    assert vertex_network is not None
    steep = scaled(network, SCALED), scaled(vertex_network, SCALED)
    found_by_search = attacks[0]
    vertices = found_by_search.vertex_network
    assert vertices is not None
    subjects = {
        "trained": _bundled("full"),
        "random": _subject(recipe, network, vertex_network),
        "random × 5": _subject(recipe, *steep),
        "adversarial": _subject(
            recipe, copy.deepcopy(found_by_search.network).float(), copy.deepcopy(vertices).float()
        ),
    }
    found = [certify(one, laboratory, name) for name, one in subjects.items()]
    rows = tuple(certificate_row(one)[:WITHOUT_PUBLISHED] for one in zip(*found, strict=True))
    return Outcome(
        tables=(
            Table(
                "both_rules",
                "Certificates T1–T8 with the vertex rule",
                CERTIFICATE_COLUMNS[:WITHOUT_PUBLISHED],
                rows,
            ),
            Table(
                "both_rules_adversarial",
                "Adversaries over both networks and the mesh",
                ATTACK_COLUMNS[:-1],
                tuple(attack_row(one)[:-1] for one in attacks),
            ),
        ),
        notes=NOTES,
    )


def _bundled(name: str) -> Subject:
    model = load_model(name)
    return subject_of_model(model, double_model(model, read_bytes(name)))


def _subject(recipe: Recipe, network: BoundedNet, vertices: BoundedNet) -> Subject:
    return subject_of_network(recipe_model(recipe, network, vertices), recipe.budget)


EXPERIMENT = Experiment(
    name="both-rules",
    title="Guarantees with the vertex rule",
    source="Beyond the paper.",
    run=run,
    seconds=300,
    reads=model_files,
)
