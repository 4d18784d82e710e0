"""T2, SE(3)-equivariance: refining a moved mesh is moving the refined mesh."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from pns_common import Mesh, Scheme
from pns_common.model.card import DIRECTED_FORMAT
from train.certificates.bodies import Body, random_motion
from train.certificates.step import step
from train.certificates.subject import Certificate, Subject, worst
from train.refining import Creases
from train.vectors import norm, unit

EXACT = 1e-12
# Of the envelope C h² / R: a feature's last single precision bit may turn with the mesh.
SINGLE = 1e-6

# A face's smallest sine, and the length of n1 + n2, above which frames are well conditioned.
#
# Antiparallel faces, where the fallback begins, are at a length of 1.4e-3.
WELL_SHAPED = 1e-2


def equivariance(subject: Subject, bodies: Sequence[Body], seed: int) -> list[Certificate]:
    """Certify T2 with the network in double precision, and again as the scheme runs.

    Schemes that correct once keep mirrors too, and with models of format 4 faces turned over; one
    of directed edges tells convex from concave. Slivers and nearly folded edges are left out:
    rounding is amplified beyond any tolerance there, and a fallback frame does not turn with the
    mesh.
    """
    rows = [_certify(subject, subject.exact, bodies, seed, "double precision")]
    if subject.is_single_precision:
        rows.append(_certify(subject, subject.scheme, bodies, seed, "as it runs", single=SINGLE))
    card = subject.learned_once
    if card is not None:
        hows = {"mirrors": -1} | ({} if card.format == DIRECTED_FORMAT else {"turning over": 1})
        for how, mirror in hows.items():
            rows.append(_certify(subject, subject.exact, bodies, seed, how, mirror, -1))
    return rows


def _certify(
    subject: Subject,
    scheme: Scheme,
    bodies: Sequence[Body],
    seed: int,
    how: str,
    mirror: int = 1,
    order: int = 1,
    *,
    single: float = 0.0,
) -> Certificate:
    rng = np.random.default_rng(seed)
    measured, left_out = [], 0
    for body in bodies:
        turn, shift = random_motion(rng)
        apart, kept = discrepancy(scheme, body.mesh, turn * [mirror, 1, 1], shift, order)
        reach = subject.base.plain(body.mesh.vertices, body.mesh.polygons).reach
        # In units of what rounding allows, so that one number serves every mesh.
        share = apart / (EXACT + single * subject.budget * reach**2) * (single or EXACT)
        measured.append((float(np.max(share[kept], initial=0)), body.name))
        left_out += int((~kept).sum())
    value, place = worst(measured)
    where = f"{place}; {left_out} ill-conditioned left out" if left_out else place
    return Certificate("T2", f"equivariance, {how}", value, high=single or EXACT, where=where)


def discrepancy(
    scheme: Scheme,
    mesh: Mesh,
    turn: Float[np.ndarray, "3 3"],
    shift: Float[np.ndarray, "3"],
    order: int = 1,
) -> tuple[Float[np.ndarray, " N"], Bool[np.ndarray, " N"]]:
    """Return ‖S(gM) − g S(M)‖ at each new vertex, and which vertices the theorem speaks of.

    ``order`` is −1 for faces turned over.
    """
    faces = [face[::order] for face in mesh.polygons]
    moved = Mesh(mesh.vertices @ turn.T + shift, faces)
    # Inside out, what was convex is concave, and may be less sharp.
    creases: Creases = "auto" if order * np.linalg.det(turn) > 0 else None
    still, after = (step(scheme, each, creases).positions for each in (mesh, moved))
    # The same edges, which turned faces number in another order.
    here, there = (np.lexsort(each.topology().edges.T) for each in (mesh, moved))
    places = np.arange(len(still))
    places[len(mesh.vertices) + here] = len(mesh.vertices) + there
    apart = np.linalg.norm(after[places] - (still @ turn.T + shift), axis=1)
    kept = [np.ones(len(mesh.vertices), dtype=bool), well_conditioned(mesh), _shapes(mesh)[1]]
    return apart, np.concatenate(kept)[: len(still)]


def well_conditioned(mesh: Mesh) -> Bool[np.ndarray, " E"]:
    """Mark edges between well-shaped faces, not nearly folded; also others than interior."""
    topology, (normals, well_shaped) = mesh.topology(), _shapes(mesh)
    faces = topology.face_of(topology.half_edges[topology.interior])
    is_open = np.linalg.norm(normals[faces].sum(axis=1), axis=1) > WELL_SHAPED
    good = np.ones(len(topology.edges), dtype=bool)
    good[topology.interior] = well_shaped[faces].all(axis=1) & is_open
    return good


def _shapes(mesh: Mesh) -> tuple[Float[np.ndarray, "F 3"], Bool[np.ndarray, " F"]]:
    """Return unit normals of faces, and whether their smallest sine is large enough.

    That is twice a triangle's area over the product of its two longest sides.
    """
    starts, degrees = mesh.offsets[:-1], np.diff(mesh.offsets)
    # From each face's first corner: beyond its last one comes the next face's, which is 0 too.
    arms = mesh.vertices[mesh.corners] - np.repeat(mesh.vertices[mesh.corners[starts]], degrees, 0)
    following = np.roll(arms, -1, axis=0)
    areas = np.add.reduceat(np.cross(arms, following), starts)
    sides = norm(following - arms)
    falling = sides[np.lexsort((-sides, np.repeat(starts, degrees)))]
    return unit(areas), norm(areas) > WELL_SHAPED * falling[starts] * falling[starts + 1]
