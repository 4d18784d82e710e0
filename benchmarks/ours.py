"""`python -m benchmarks.ours NAME MESH LEVELS`: our refinement behind the peers' protocol.

NAME is loop or the name of a bundled model; quads go to Catmull–Clark and the model's companion.
The report is made when it is first read: NAME+report reads it, with all its diagnostics, in every
run.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.peers.protocol import read_mesh, serve
from pns_common import Mesh, catmull_clark, load_model, loop, pns, refine
from pns_common.mesh.topology import TRIANGLE


def main(name: str, path: str, levels: str) -> None:
    """Serve runs on one mesh."""
    points, faces = read_mesh(path)
    wide = faces.astype(np.int64)
    method, _, report = name.partition("+")
    base = loop() if faces.shape[1] == TRIANGLE else catmull_clark()
    scheme = base if method == "loop" else pns(load_model(method))

    def run() -> tuple[np.ndarray, np.ndarray]:
        refined = refine(Mesh(points, wide), scheme, int(levels), limit=False)
        if report:
            assert len(refined.report["levels"]) == int(levels)
        return refined.mesh.vertices, refined.mesh.faces

    serve(run)


if __name__ == "__main__":
    main(*sys.argv[1:])
