"""The spectrum of a scheme at a star: its Jacobian, Loop's eigenvalues, the Reif gap and margin."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from torch import Tensor

from pns_common import Mesh, ParameterError, Scheme
from train.refining import refine
from train.spectra import stars
from train.spectra.stars import BuildStar, Star, Subspace, keeps_blocks, symmetry_blocks

# Spoke of every star, in reference lengths.
SPOKE = 0.25

# Step of the central differences, in spokes: their error is then about 1e-10.
STEP = 1e-5

# Rings of a star and how many of them are inner, tried in this order.
RINGS = ((2, 2), (3, 2), (4, 3), (6, 4))

VALENCES = tuple(range(3, 13))
# Loop's tangent eigenvalue is double, once for each of three coordinates.
TANGENT_COUNT = 6

# Eigenvalues are followed in growing strides: gates open at small lifts, where most moves.
FIRST_LIFT, GROWTH = 0.006, 1.3


def loop_eigenvalue(valence: int, frequency: int = 1) -> float:
    """Return 3/8 + ¼ cos 2πj/k; j = 1 is the tangent eigenvalue, real and double."""
    return 3 / 8 + math.cos(2 * math.pi * frequency / valence) / 4


def loop_third(valence: int) -> float:
    """Return Loop's largest |λ| below the tangent pair: of frequency 0, of frequency 2, or 1/8.

    The 1/8 belongs to the second ring; the paper's (k+1)-star leaves it out, and so puts the gap
    at k = 3 at 3/16 rather than 1/8.
    """
    second = loop_eigenvalue(valence, 2) if valence >= 4 else 0.0
    return max(loop_eigenvalue(valence) ** 2, second, 1 / 8)


def loop_gap(valence: int) -> float:
    """Return Loop's Reif gap λ_t − |λ_3|."""
    return loop_eigenvalue(valence) - loop_third(valence)


def catmull_clark_eigenvalue(valence: int, frequency: int = 1) -> float:
    """Return the larger eigenvalue of a frequency from 1 on; of 1 it is the tangent eigenvalue.

    (5 + c + cos(πj/k) √(18 + 2 c)) / 16 with c = cos 2πj/k: Halstead, Kass and DeRose, 1993.
    """
    half = math.pi * frequency / valence
    c = math.cos(2 * half)
    return (5 + c + math.cos(half) * math.sqrt(18 + 2 * c)) / 16


def catmull_clark_gap(valence: int) -> float:
    """Return Catmull–Clark's Reif gap: the third is of frequency 0, or of frequency 2."""
    k = valence
    third = (3 - 7 / k + math.sqrt((3 - 7 / k) ** 2 + 12 / k - 4)) / 8
    if k >= 4:
        third = max(third, catmull_clark_eigenvalue(k, 2))
    return catmull_clark_eigenvalue(k) - third


def reif_gap(size: Float[np.ndarray, " M"]) -> float:
    """Return λ_t − |λ_3| of eigenvalues' magnitudes without translations, largest first."""
    return float(size[TANGENT_COUNT - 1] - size[TANGENT_COUNT])


def closed_star(
    scheme: Scheme, valence: int, shake: float = 1 / 20, build_star: BuildStar = stars.star
) -> Callable[[float], Star]:
    """Return the stars, by lift, on which a scheme maps the inner rings to themselves.

    Two rings suffice where an edge sees its two faces and a vertex its neighbours; a scheme that
    sees further gets more. Tried out on a star shaken by so many spokes: what lies outside must
    change nothing. Sharpness looks at the whole mesh, but near a plane nothing is sharp.

    Raises:
        ParameterError: the scheme sees further than all rings tried.
    """
    for rings, inner_rings in RINGS:
        build = partial(build_star, valence, rings, SPOKE, inner_rings=inner_rings)
        alone = build(0.0)
        wider = build_star(valence, rings + 2, SPOKE, inner_rings=inner_rings)
        noise = np.random.default_rng(0).standard_normal(wider.mesh.vertices.shape) * SPOKE * shake
        refined = []
        for star in (alone, wider):
            mesh = Mesh(star.mesh.vertices + noise[: len(star.mesh.vertices)], star.mesh.faces)
            refined.append(refine(mesh, scheme, 1, 1.0).mesh.vertices[star.refined])
        outside = noise[: len(alone.mesh.vertices)].copy()
        outside[len(alone.inner) :] *= -1
        mesh = Mesh(alone.mesh.vertices + outside, alone.mesh.faces)
        refined.append(refine(mesh, scheme, 1, 1.0).mesh.vertices[alone.refined])
        if max(np.abs(positions - refined[0]).max() for positions in refined) < 1e-12:
            return build
    raise ParameterError("scheme", scheme.name, expected="a rule that sees at most four rings")


def perturbed_stars(star: Star, step: float) -> tuple[Mesh, int]:
    """Return one mesh of copies of a star, and the number of inner coordinates M.

    Copy n < M has inner coordinate n moved by +step, copy M + n by −step. One call of the
    operator then differentiates it in every direction.
    """
    points, faces = star.mesh.vertices, star.mesh.faces
    count = 3 * len(star.inner)
    copies = np.repeat(points[None], 2 * count, axis=0)
    column = np.arange(count)
    copies[column, star.inner[column // 3], column % 3] += step
    copies[count + column, star.inner[column // 3], column % 3] -= step
    offsets = np.arange(2 * count)[:, None, None] * len(points)
    copied = (faces[None] + offsets).reshape(-1, faces.shape[1])
    return Mesh(copies.reshape(-1, 3), copied), count


Coordinates = TypeVar("Coordinates", np.ndarray, Tensor)


def refined_inner(
    star: Star, refined: Float[Coordinates, "V 3"], copies: int
) -> Float[Coordinates, "S M"]:
    """Return the refined inner coordinates of each of `copies` stars that were refined together."""
    # Rows are the old vertices of all copies, then those of their edges, then those of faces.
    whole, old = len(refined) // copies, len(star.mesh.vertices)
    faces = 0 if star.mesh.triangles else star.mesh.face_count
    starts = np.array([0, old, whole - faces, whole])
    kind = np.searchsorted(starts, star.refined, side="right") - 1
    first, size = starts[kind], np.diff(starts)[kind]
    rows = copies * first + np.arange(copies)[:, None] * size + star.refined - first
    return refined[rows].reshape(copies, -1)


def jacobian(scheme: Scheme, star: Star, step: float = STEP) -> Float[np.ndarray, "M M"]:
    """Differentiate one step of a scheme, inner rings to inner rings in all coordinates.

    By central differences on the scheme itself, in double precision: any scheme will do, and
    nothing is assumed of how it computes. `step` is in spokes; the reference length is 1.
    """
    step = step * SPOKE
    mesh, count = perturbed_stars(star, step)
    refined = refine(mesh, scheme, levels=1, reference_length=1.0).mesh.vertices
    moved = refined_inner(star, refined, 2 * count)
    return (moved[:count] - moved[count:]).T / (2 * step)


def translation_quotient(size: int) -> Float[np.ndarray, "M L"]:
    """Return an orthonormal basis Q of what is orthogonal to the translations, L = M − 3.

    A scheme that commutes with translations keeps their space, so that Qᵀ J Q has exactly the
    spectrum of J but for three eigenvalues 1.
    """
    translations = np.kron(np.ones((size // 3, 1)), np.eye(3))
    return np.linalg.qr(translations, mode="complete").Q[:, 3:]


def quotient_blocks(star: Star, valence: int) -> tuple[Subspace, ...]:
    """Return a star's symmetry blocks on the quotient by translations."""
    basis, blocks = translation_quotient(3 * len(star.inner)), []
    for block in symmetry_blocks(star, valence):
        left, size, _ = np.linalg.svd(basis.T @ block, full_matrices=False)
        # Translations lie within blocks and leave a direction of length 0.
        blocks.append(left[:, size > 1 / 2])
    return tuple(blocks)


def without_translations(matrix: Float[np.ndarray, "M M"]) -> Float[np.ndarray, "L L"]:
    """Return the matrix on the quotient by translations."""
    basis = translation_quotient(len(matrix))
    return basis.T @ matrix @ basis


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues of a star's Jacobian on the quotient by translations.

    Attributes:
        right, left: eigenvectors as columns of one and rows of the other, its inverse.
        tangent: the six eigenvalues continued from Loop's tangent pair.
        blocks: invariant subspaces, eigenvalues of which are followed apart.
        block: which of them each eigenvalue belongs to.
    """

    values: Complex[np.ndarray, " L"]
    right: Complex[np.ndarray, "L L"]
    left: Complex[np.ndarray, "L L"]
    tangent: Bool[np.ndarray, " L"]
    blocks: tuple[Subspace, ...]
    block: Int[np.ndarray, " L"]

    @property
    def least_tangent(self) -> int:
        """Return which of the tangent eigenvalues is smallest."""
        return int(np.argmin(np.where(self.tangent, np.abs(self.values), np.inf)))

    @property
    def largest_other(self) -> int:
        """Return which of the others is largest."""
        return int(np.argmax(np.where(self.tangent, -1.0, np.abs(self.values))))

    @property
    def margin(self) -> float:
        """The signed Reif margin: negative where another eigenvalue has overtaken the tangents."""
        size = np.abs(self.values)
        return float(size[self.least_tangent] - size[self.largest_other])

    @property
    def largest(self) -> float:
        """The largest |λ|; 1 or more is unstable."""
        return float(np.abs(self.values).max())


def flat_spectrum(
    matrix: Float[np.ndarray, "L L"], valence: int, blocks: tuple[Subspace, ...] = ()
) -> Spectrum:
    """Return the spectrum of a flat star: the tangents are the six nearest Loop's.

    Args:
        blocks: invariant subspaces of all matrices that will follow; without any, the whole space.
    """
    spectrum = _decomposed(matrix, blocks or (np.eye(len(matrix)),))
    nearest = np.argsort(np.abs(spectrum.values - loop_eigenvalue(valence)), kind="stable")
    return replace(spectrum, tangent=_marked(nearest[:TANGENT_COUNT], len(spectrum.values)))


def continued_spectrum(matrix: Float[np.ndarray, "L L"], before: Spectrum) -> Spectrum:
    """Return the spectrum of a star a little different from the one before.

    The tangents of each block are as many as before, those whose eigenvectors lie most in the
    tangent space before, by its spectral projector: an oblique one, because the matrix is not
    normal.
    """
    spectrum = _decomposed(matrix, before.blocks)
    projector = before.right[:, before.tangent] @ before.left[before.tangent]
    nearness = np.linalg.norm(projector @ spectrum.right, axis=0)
    tangents = []
    for block in range(len(before.blocks)):
        count = int(before.tangent[before.block == block].sum())
        own = np.flatnonzero(spectrum.block == block)
        nearest = own[np.argsort(-nearness[own], kind="stable")]
        tangents.append(nearest[:count])
    return replace(spectrum, tangent=_marked(np.concatenate(tangents), len(spectrum.values)))


def follow_lift(scheme: Scheme, valence: int, lifts: Sequence[float]) -> list[Spectrum]:
    """Follow the spectrum of a star while its centre is lifted; the first lift is 0.

    Between two lifts they are followed in smaller strides.

    Lifted stars are no fixed points, so the margin is a diagnostic, not Reif's condition.
    """
    build = closed_star(scheme, valence)

    def matrix(lift: float) -> Float[np.ndarray, "L L"]:
        return without_translations(jacobian(scheme, build(lift)))

    blocks = quotient_blocks(build(0.0), valence)
    # A rule that depends on the numbering of vertices does not keep the star's symmetries.
    blocks = blocks if keeps_blocks(matrix(lifts[-1]), blocks) else ()
    followed = [flat_spectrum(matrix(lifts[0]), valence, blocks)]
    for start, end in pairwise(lifts):
        spectrum = followed[-1]
        for lift in strides(start, end):
            spectrum = continued_spectrum(matrix(lift), spectrum)
        followed.append(spectrum)
    return followed


def strides(start: float, end: float) -> list[float]:
    """Return the lifts after `start` up to `end`, each GROWTH times the one before."""
    ends, lift = [], max(start * GROWTH, FIRST_LIFT)
    while lift < end:
        ends.append(lift)
        lift *= GROWTH
    return [*ends, end]


def _decomposed(matrix: Float[np.ndarray, "L L"], blocks: tuple[Subspace, ...]) -> Spectrum:
    """Return the eigenvalues of every block; which are tangents is still open."""
    values, right, left = [], [], []
    for block in blocks:
        own, vectors = np.linalg.eig(block.T @ matrix @ block)
        values.append(own)
        right.append(block @ vectors)
        # Where two eigenvalues just meet there is no inverse.
        left.append(np.linalg.pinv(vectors) @ block.T)
    return Spectrum(
        values=np.concatenate(values),
        right=np.concatenate(right, axis=1),
        left=np.concatenate(left),
        tangent=np.zeros(len(matrix), dtype=bool),
        blocks=blocks,
        block=np.repeat(np.arange(len(blocks)), [len(own) for own in values]),
    )


def _marked(rows: Int[np.ndarray, " N"], count: int) -> Bool[np.ndarray, " L"]:
    """Return which of `count` rows are named."""
    marks = np.zeros(count, dtype=bool)
    marks[rows] = True
    return marks
