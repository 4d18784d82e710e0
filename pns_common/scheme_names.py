"""The base schemes by name, for Python, the command line and HTTP: one line each."""

from __future__ import annotations

from collections.abc import Mapping

# Each stands in a file of its own. Named as text: who asks for the names loads no compiler.
BASE_SCHEMES: Mapping[str, str] = {
    "loop": "pns_common.schemes.loop:LOOP",
    "catmull-clark": "pns_common.schemes.catmull_clark:CATMULL_CLARK",
}
