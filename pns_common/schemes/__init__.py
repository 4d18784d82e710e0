"""Base schemes, one file each: masks, limit masks, split; the matrix that they make."""

from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.catmull_clark import CATMULL_CLARK
from pns_common.schemes.loop import LOOP

__all__ = ["CATMULL_CLARK", "LOOP", "BaseScheme"]
