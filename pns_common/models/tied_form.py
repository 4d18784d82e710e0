"""What remains of a tied network's weights once the group is divided out.

A group of n = 2^b commuting symmetries has n characters χ_s(g) = (−1)^|s & g|. Over the copies
g of a unit the sums Σ_g χ_s(g) x_g are eigenvectors of everything that the group commutes with, so
each hidden layer falls into n blocks of m × m in place of one of n m × n m, and the features into
sums and differences that each know one character:

    first layer     row (g, i) is W_i, permuted and signed by g     18 m products, not 18 n m
    hidden layers   entry ((g, i), (h, j)) is K_ij[g h]             n m m' products, not n² m m'
    last layer      column (g, i) is D_g v_i                        3 m products, not 3 n m

That a file's matrices are of this form is proved here entry by entry, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int, Int32

from pns_common.features.symmetry import Symmetries


@dataclass(frozen=True, eq=False)
class Layer:
    """W x + b."""

    weight: Float[np.ndarray, "N M"]
    bias: Float[np.ndarray, " N"]


@dataclass(frozen=True, eq=False)
class TiedForm:
    """A tied perceptron: n copies of m units in each of its L hidden layers.

    Attributes:
        order: the features as they stand from here on, by character.
        pairs: those that are replaced by their sum and their difference, in this order.
        characters: s of each feature after that; they ascend.
        widths: m of each hidden layer.
        first: products of the first layer: units with features.
        hidden: those of each later one, (n, m, m') after one another.
        biases: of the hidden layers, after one another.
        last: products of the last layer.
        last_characters: s of each coordinate.
        last_bias: 0 but where s is.
    """

    order: Int32[np.ndarray, " K"]
    pairs: Int32[np.ndarray, "P 2"]
    characters: Int32[np.ndarray, " K"]
    widths: Int32[np.ndarray, " L"]
    first: Float32[np.ndarray, "M K"]
    hidden: Float32[np.ndarray, " H"]
    biases: Float32[np.ndarray, " B"]
    last: Float32[np.ndarray, "3 N"]
    last_characters: Int32[np.ndarray, " 3"]
    last_bias: Float32[np.ndarray, " 3"]
    copies: int

    def __repr__(self) -> str:
        return f"TiedForm(widths={self.widths.tolist()}, copies={self.copies})"


def tied_form(layers: Sequence[Layer], group: Symmetries) -> TiedForm | None:
    """Return what remains of a perceptron; None for none, and where the group does not tie it."""
    size = len(group.order)
    if size == 1 or len(layers) < 2:
        return None
    first, *hidden, last = layers
    widths = [len(layer.weight) // size for layer in (first, *hidden)]
    if not _is_tied(layers, widths, group):
        return None
    # Dividing by n, a power of two, is exact.
    mean = character_table(size) / size
    pairs, characters, basis = feature_basis(group)
    images = first.weight.reshape(size, widths[0], -1)
    of_character = np.einsum("sg,gik->sik", mean, images)[characters]
    products = np.einsum("kic,kc->ik", of_character, basis) / np.sum(basis**2, axis=1)
    order = np.argsort(characters, kind="stable")
    place = np.argsort(order)
    blocks = [
        np.einsum("sg,igj->sij", mean, layer.weight[:m].reshape(m, size, -1))
        for layer, m in zip(hidden, widths[1:], strict=True)
    ]
    biases = [layer.bias[:m] for layer, m in zip((first, *hidden), widths, strict=True)]
    return TiedForm(
        order=order.astype(np.int32),
        pairs=place[np.array(pairs, dtype=np.int32).reshape(-1, 2)].astype(np.int32),
        characters=characters[order].astype(np.int32),
        widths=np.array(widths, dtype=np.int32),
        first=_single(products[:, order]),
        hidden=_single(np.concatenate([np.zeros(0), *(block.reshape(-1) for block in blocks)])),
        biases=_single(np.concatenate(biases)),
        last=_single(last.weight[:, : widths[-1]]),
        last_characters=_characters(group.local[_generators(size)]),
        last_bias=_single(last.bias),
        copies=size,
    )


def character_table(size: int) -> Float[np.ndarray, "G G"]:
    """Return χ_s(g), by s and g."""
    table = np.ones((1, 1))
    while len(table) < size:
        table = np.block([[table, table], [table, -table]])
    return table


def feature_basis(
    group: Symmetries,
) -> tuple[list[tuple[int, int]], Int[np.ndarray, " K"], Float[np.ndarray, "K K"]]:
    """Return sums and differences of features that each know one character.

    Returns the pairs that are replaced by their sum and their difference, in order; the character
    of each in the end; and what they are of the features.
    """
    count = group.order.shape[1]
    basis, pairs = np.eye(count), list[tuple[int, int]]()
    generators = _generators(len(group.order))
    acts = [np.eye(count)[group.order[g]] * group.signs[g][:, None] for g in generators]
    for act in acts:
        moved = _in_basis(act, basis)
        for k in range(count):
            partner = int(np.flatnonzero(moved[k])[0])
            if partner > k:
                pairs.append((k, partner))
                basis[[k, partner]] = basis[k] + basis[partner], basis[k] - basis[partner]
    signs = np.array([np.diag(_in_basis(act, basis)) for act in acts])
    return pairs, _characters(signs), basis


def _in_basis(
    act: Float[np.ndarray, "K K"], basis: Float[np.ndarray, "K K"]
) -> Float[np.ndarray, "K K"]:
    """Return what a symmetry does to sums and differences: a permutation of them, with signs."""
    # The rows are orthogonal, and their entries 0, 1 and −1: all of this is exact.
    return basis @ act @ (basis / np.sum(basis**2, axis=1)[:, None]).T


def _is_tied(layers: Sequence[Layer], widths: Sequence[int], group: Symmetries) -> bool:
    size = len(group.order)
    first, *hidden, last = layers
    if any(len(layer.weight) != size * m for layer, m in zip(layers, widths, strict=False)):
        return False
    if not all(np.isfinite(each).all() for layer in layers for each in (layer.weight, layer.bias)):
        return False
    own = first.weight[: widths[0]]
    tied = [
        np.array_equal(image[:, group.order[g]], own * group.signs[g])
        for g, image in enumerate(first.weight.reshape(size, widths[0], -1))
    ]
    product = np.bitwise_xor.outer(np.arange(size), np.arange(size))
    for layer, m in zip(hidden, widths[1:], strict=True):
        entries = layer.weight.reshape(size, m, size, -1)
        wanted = entries[0][:, product].transpose(1, 0, 2, 3)
        tied.append(np.array_equal(entries, wanted))
    for layer, m in zip((first, *hidden), widths, strict=True):
        tied.append(np.array_equal(layer.bias, np.tile(layer.bias[:m], size)))
    columns = last.weight.reshape(3, size, -1)
    tied.append(np.array_equal(columns, group.local.T[:, :, None] * columns[:, :1]))
    tied.append(np.array_equal(group.local * last.bias, np.tile(last.bias, (size, 1))))
    return all(tied)


def _generators(size: int) -> list[int]:
    """Return which elements make all others: the group's numbering has one bit for each."""
    return [1 << bit for bit in range(size.bit_length() - 1)]


def _characters(signs: Float[np.ndarray, "B N"]) -> Int32[np.ndarray, " N"]:
    """Return s of what each generator multiplies by such signs."""
    bits = (1 << np.arange(len(signs)))[:, None]
    return np.sum(np.where(signs < 0, bits, 0), axis=0).astype(np.int32)


def _single(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=np.float32)
