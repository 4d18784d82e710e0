"""`python -m pns_common.fused`: compile all kernels into the cache, as an image does when built."""

from __future__ import annotations

import sys

from pns_common.fused import load_kernels
from pns_common.fused.storage import cache_folder

if __name__ == "__main__":
    if not load_kernels():
        sys.exit("no kernels: numba is not installed, or no folder can be written")
    print(f"kernels are in {cache_folder()}")
