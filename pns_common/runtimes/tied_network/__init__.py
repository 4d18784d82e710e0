"""Networks with tied weights, by a program of our own: fewer products, the same bits everywhere.

A file is proved to be one (models/tied_form.py) before it is run as one; array code (arrays.py) and
a compiled kernel (``pns_common.fused``) give the same bits, and whichever is at hand serves.
"""

from pns_common.runtimes.tied_network.network import TiedNetwork, open_tied_network

__all__ = ["TiedNetwork", "open_tied_network"]
