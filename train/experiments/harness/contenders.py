"""Methods that are compared everywhere: untrained controls, Butterfly, Loop, the default model.

The default keeps crease lines sharp: what that alone gains stands beside it, by Loop and by N1 with
the same lines, and what the rest gains, by the default without them.
"""

from pns_common import load_model, loop, pns
from train.baselines.butterfly import modified_butterfly
from train.baselines.controls import flat, n1, nc, q1
from train.refining import AnyScheme, Method, Smooth, loop_rule

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
        LOOP_CREASED: Method("loop", loop_rule, keeps_creases=True),
        N1_CREASED: n1(keeps_creases=True),
        OURS_SMOOTH: Smooth(ours),
        OURS: ours,
    }
