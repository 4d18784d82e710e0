"""Schemes: what ``refine`` applies. A base scheme is one file here; a learned rule adds to it."""

from pns_common.base_scheme import BaseScheme
from pns_common.schemes.loop import LOOP
from pns_common.schemes.scheme import Scheme, loop, pns

__all__ = ["LOOP", "BaseScheme", "Scheme", "loop", "pns"]
