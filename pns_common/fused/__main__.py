"""`python -m pns_common.fused`: compile all kernels into the cache, as an image does when built."""

from __future__ import annotations

import sys

from pns_common.fused import load_kernels

if __name__ == "__main__":
    if not load_kernels():
        sys.exit("no kernels: numba is not installed, or no folder can be written")
    # Without numba there is nothing that it could load.
    from pns_common.fused.library import place_of_kernels

    file = place_of_kernels()
    if not file.exists():
        sys.exit(f"kernels are not kept: {file.parent} is full, or cannot be written")
    print(f"kernels are in {file.parent}")
