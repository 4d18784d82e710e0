"""A mesh refined piece by piece, with the bits of the whole: for meshes larger than memory."""

from pns_common.pieces.halo import ThinHaloError, halo_rings, reach
from pns_common.pieces.piece import Piece, RefinedPiece, refine_piece
from pns_common.pieces.tally import LevelTally, ReducedReport, reduced_report

__all__ = [
    "LevelTally",
    "Piece",
    "ReducedReport",
    "RefinedPiece",
    "ThinHaloError",
    "halo_rings",
    "reach",
    "reduced_report",
    "refine_piece",
]
