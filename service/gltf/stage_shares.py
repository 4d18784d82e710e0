"""Which share of a file's work, and of a mesh's, each stage is: a prediction, for progress."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

from pns_common.levels.progress import LEARNED_COST
from pns_common.schemes import Scheme

from ..options import Options

# Of a whole file: up to where it is read, and from where it is put together.
READ, PUT_TOGETHER = 0.03, 0.95

# What a stage takes for each refined face, where all passes of Loop with their report take 1:
# measured on a part of 2,000 faces with normals and texture coordinates at four and five levels.
WELD, ATTRIBUTES = 0.05, 1.7
WRITE = {"none": 0.1, "meshopt": 2.5, "draco": 25.0}
LIMIT = 2.0


@dataclass(frozen=True)
class StageShares:
    """Where the stages of a mesh's work begin, as shares of it; what is left is for writing it."""

    weld: float
    refine: float
    attributes: float
    write: float


def stage_shares(scheme: Scheme, options: Options) -> StageShares:
    """Return the shares under some options."""
    made = [4**level for level in range(1, options.levels + 1)]
    learned = made if scheme.learned_levels is None else made[: scheme.learned_levels]
    refine = 1 + LEARNED_COST * sum(learned) / sum(made) + LIMIT * options.limit
    costs = [0.05, WELD, refine, ATTRIBUTES, WRITE[options.compress]]
    return StageShares(*(end / sum(costs) for end in list(accumulate(costs))[:-1]))
