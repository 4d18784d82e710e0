"""Memory that a call frees stays with the process for the next one, up to some 60 MB.

glibc gives memory back to the system as soon as the free end of its heap is larger than twice the
largest block that was ever freed on its own, and then each call's tables are new pages again, which
the system clears: a third of Loop's time at 80,000 faces. That bound grows with what is freed, up
to blocks of 32 MB. One such block, never written and so never in memory, sets it once for all: just
as the first call of 320,000 faces does.
"""

from __future__ import annotations

import numpy as np

# glibc takes no notice of blocks of 32 MiB or more.
LARGEST_NOTICED = 31 * 2**20


def keep_freed_memory() -> None:
    """Let the allocator keep what this process frees; where it is not glibc's nothing changes."""
    block = np.empty(LARGEST_NOTICED, dtype=np.uint8)
    del block
