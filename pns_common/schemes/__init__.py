"""Schemes: what ``refine`` applies. A base scheme is one file here; a learned rule adds to it."""

from pns_common.base_scheme import BaseScheme
from pns_common.schemes.catmull_clark import CATMULL_CLARK
from pns_common.schemes.loop import LOOP
from pns_common.schemes.scheme import NAMES, Scheme, catmull_clark, loop, named_scheme, pns

__all__ = [
    "CATMULL_CLARK",
    "LOOP",
    "NAMES",
    "BaseScheme",
    "Scheme",
    "catmull_clark",
    "loop",
    "named_scheme",
    "pns",
]
