"""Refine to control points: for claims on masks, levels and columns, before the limit surface."""

from functools import partial

import pns_common

refine = partial(pns_common.refine, limit=False)
