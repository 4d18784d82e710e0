"""Who is compared everywhere: the untrained controls, Butterfly, Loop, and the default model.

The default keeps crease lines sharp: what that alone gains stands beside it, by Loop and by N1 with
the same lines, and what the rest gains, by the default without them.
"""

from dataclasses import replace

from pns_common.connectivity.creases import NO_CREASES
from pns_common.runtimes.onnx_model import load_model
from pns_common.schemes import loop, pns
from train.baselines.butterfly import modified_butterfly
from train.baselines.controls import flat, nc
from train.refining import AnyScheme
from train.surfaces.quasi_interpolation import n1, q1

LOOP, OURS = "Loop", "PNS"
LOOP_CREASED, N1_CREASED, OURS_SMOOTH = "Loop, creases", "N1, creases", "PNS, no creases"


def contenders() -> dict[str, AnyScheme]:
    """Return all schemes by the names of the tables, Loop first and ours last."""
    ours = pns(load_model())
    return {
        LOOP: loop(),
        "Flat": flat(),
        "Butterfly": modified_butterfly(),
        "Q1": q1(),
        "N1": n1(),
        "NC": nc(),
        LOOP_CREASED: replace(loop(), creases=ours.creases),
        N1_CREASED: replace(n1(), creases=ours.creases),
        OURS_SMOOTH: replace(ours, creases=NO_CREASES),
        OURS: ours,
    }
