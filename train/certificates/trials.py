"""What a certificate tries a rule on: bodies of two sizes, without creases and with any."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Int

from pns_common import Mesh
from train.certificates.bodies import Body
from train.certificates.subject import Subject
from train.connectivity import connect

# Of a mesh's size. A scale-free rule asks for a share of h: only on small meshes is that more than
# the budget, which falls as h², and something to cut off.
SMALL = 2.0**-10

NO_CREASES = np.zeros((0, 2), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Trial:
    """A mesh with edges to be kept sharp, as pairs of vertices, the lower first."""

    name: str
    mesh: Mesh
    creases: Int[np.ndarray, "N 2"]


def trials(subject: Subject, bodies: Sequence[Body], seed: int) -> Iterator[Trial]:
    """Yield each body as it is, and with creases; and the same where the budget cuts off."""
    rng = np.random.default_rng(seed)
    sizes = (1.0,) if subject.learned_once is None else (1.0, SMALL)
    for body, size in product(bodies, sizes):
        mesh = Mesh(size * body.mesh.vertices, body.mesh.faces)
        name = body.name if size == 1 else f"{body.name} times {size:g}"
        yield Trial(name, mesh, NO_CREASES)
        yield Trial(f"creased {name}", mesh, drawn_creases(mesh, rng))


def drawn_creases(mesh: Mesh, rng: np.random.Generator) -> Int[np.ndarray, "N 2"]:
    """Return a quarter of a mesh's edges, which make darts, curves and corners."""
    edges = np.unique(connect(mesh.faces, len(mesh.vertices)).edges.numpy(), axis=0)
    return edges[rng.random(len(edges)) < 1 / 4]
