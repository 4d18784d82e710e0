"""T2, SE(3)-equivariance: refining a moved mesh is moving the refined mesh."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from pns_common import Mesh
from train.certificates.bodies import Body, random_motion
from train.certificates.plain_loop import plain_loop
from train.certificates.step import step
from train.certificates.subject import Certificate, Subject, worst
from train.connectivity import connect
from train.refining import AnyScheme
from train.vectors import face_normals

EXACT = 1e-12
# Of the envelope C h² / R: a feature's last single precision bit may turn with the mesh.
SINGLE = 1e-6

# A face's smallest sine, and the length of n1 + n2, above which frames are well conditioned.
#
# Antiparallel faces, where the fallback begins, are at a length of 1.4e-3.
WELL_SHAPED = 1e-2


def equivariance(subject: Subject, bodies: Sequence[Body], seed: int) -> list[Certificate]:
    """Certify T2 with the network in double precision, and again as the scheme runs.

    Edges whose frame degenerates are left out (the fallback frame does not turn with the mesh), and
    so are slivers and nearly folded edges, where rounding is amplified beyond any tolerance.
    """
    rows = [_certify(subject, subject.exact, bodies, seed, "double precision", 0.0)]
    if subject.is_single_precision:
        rows.append(_certify(subject, subject.scheme, bodies, seed, "as it runs", SINGLE))
    return rows


def _certify(
    subject: Subject, scheme: AnyScheme, bodies: Sequence[Body], seed: int, how: str, single: float
) -> Certificate:
    rng = np.random.default_rng(seed)
    measured, left_out = [], 0
    for body in bodies:
        apart, kept = discrepancy(scheme, body.mesh, *random_motion(rng))
        reach = plain_loop(body.mesh.vertices, body.mesh.faces).reach
        # In units of what rounding allows, so that one number serves every mesh.
        share = apart / (EXACT + single * subject.budget * reach**2) * (single or EXACT)
        measured.append((float(np.max(share[kept], initial=0)), body.name))
        left_out += int((~kept).sum())
    value, place = worst(measured)
    where = f"{place}; {left_out} ill-conditioned edges left out" if left_out else place
    return Certificate("T2", f"equivariance, {how}", value, high=single or EXACT, where=where)


def discrepancy(
    scheme: AnyScheme, mesh: Mesh, turn: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, " N"], Bool[np.ndarray, " N"]]:
    """Return ‖S(gM) − g S(M)‖ at each new vertex, and which vertices the theorem speaks of."""
    still = step(scheme, mesh, "auto")
    moved = step(scheme, Mesh(mesh.vertices @ turn.T + shift, mesh.faces), "auto")
    apart = np.linalg.norm(moved.positions - (still.positions @ turn.T + shift), axis=1)
    kept = ~(still.degenerate | moved.degenerate)
    kept[len(mesh.vertices) :] &= well_conditioned(mesh)
    return apart, kept


def well_conditioned(mesh: Mesh) -> Bool[np.ndarray, " E"]:
    """Mark edges between well-shaped faces, not nearly folded; also others than interior."""
    level = connect(mesh.faces, len(mesh.vertices))
    interior, half_edges = level.interior.numpy(), level.half_edges[level.interior].numpy()
    faces, normals = half_edges // 3, face_normals(mesh.vertices, mesh.faces)
    is_open = np.linalg.norm(normals[faces].sum(axis=1), axis=1) > WELL_SHAPED
    good = np.ones(len(level.edges), dtype=bool)
    good[interior] = (_smallest_sine(mesh) > WELL_SHAPED)[faces].all(axis=1) & is_open
    return good


def _smallest_sine(mesh: Mesh) -> Float[np.ndarray, " F"]:
    """Return a face's smallest sine: twice its area over the product of its two longest sides."""
    corners = mesh.vertices[mesh.faces]
    sides = corners[:, [1, 2, 0]] - corners
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    lengths = np.sort(np.linalg.norm(sides, axis=-1), axis=1)
    product = lengths[:, 1] * lengths[:, 2]
    return np.where(product > 0, area / np.where(product > 0, product, 1.0), 0.0)
