"""Shares of named columns: which of many each row has most of, and their rounding to whole units.

N rows keep K slots each: names, and their shares, heaviest first.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks


def keep_heaviest(
    columns: Float[np.ndarray, "N C"],
    names: Int[np.ndarray, " C"],
    kept_names: Int[np.ndarray, "N K"],
    kept: Float[np.ndarray, "N K"],
    lost: Float[np.ndarray, " N"],
    blocks: Blocks,
) -> None:
    """Put columns into the slots of each row where they are heavier than what is kept there.

    Of equals, what was there before stays first, then the earlier column. What finds no slot is
    added to ``lost``. A slot of nothing has the name 0.
    """

    def keep(share: slice) -> None:
        rows = share.start + np.flatnonzero(columns[share].any(axis=1))
        heavy = np.hstack([kept[rows], columns[rows]])
        named = np.hstack([kept_names[rows], np.broadcast_to(names, (len(rows), len(names)))])
        order = np.argsort(-heavy, axis=1, kind="stable")
        named, heavy = (np.take_along_axis(part, order, axis=1) for part in (named, heavy))
        slots = kept.shape[1]
        kept_names[rows] = np.where(heavy[:, :slots] > 0, named[:, :slots], 0)
        kept[rows] = heavy[:, :slots]
        lost[rows] += heavy[:, slots:].sum(axis=1)

    blocks.run(len(columns), keep)


def scale_rows(weights: Float[np.ndarray, "N K"], blocks: Blocks) -> None:
    """Scale rows, in their place, so that each sums to 1; those without weight stay 0."""

    def scale(rows: slice) -> None:
        total = weights[rows].sum(axis=1, keepdims=True)
        weights[rows] /= np.where(total > 0, total, 1.0)

    blocks.run(len(weights), scale)


def whole_units(
    weights: Float[np.ndarray, "N K"], total_units: int, blocks: Blocks
) -> Int[np.ndarray, "N K"]:
    """Round weights to integers that sum to ``total_units`` a row: largest remainders go up.

    Rows without weight stay 0. Units are below 2³¹.
    """
    units = np.empty(weights.shape, dtype=np.int32)

    def write(rows: slice) -> None:
        total = weights[rows].sum(axis=1, keepdims=True)
        exact = total_units * weights[rows] / np.where(total > 0, total, 1.0)
        down = np.floor(exact)
        missing = np.where(total > 0, total_units - down.sum(axis=1, keepdims=True), 0)
        units[rows] = down + (_places(down - exact) < missing)

    blocks.run(len(weights), write)
    return units


def _places(keys: Float[np.ndarray, "N K"]) -> Int[np.ndarray, "N K"]:
    """Return which in its row each number is, ascending; of equals, the earlier comes first."""
    slots = np.ascontiguousarray(keys.T)
    places = np.empty(slots.shape, dtype=np.int64)
    # A loop over slots, of which there are few.
    for slot, own in enumerate(slots):
        less = own < slots[:slot]
        places[:slot] += less
        places[slot] = slot - less.sum(axis=0)
    return places.T
