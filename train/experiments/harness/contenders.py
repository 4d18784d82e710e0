"""Who is compared everywhere: the untrained controls, Butterfly, Loop, and the default model."""

from pns_common.runtimes.onnx_model import load_model
from pns_common.schemes import Scheme, loop, pns
from train.baselines.butterfly import modified_butterfly
from train.baselines.controls import flat, nc
from train.surfaces.quasi_interpolation import n1, q1

LOOP, OURS = "Loop", "PNS"


def contenders() -> dict[str, Scheme]:
    """Return all schemes by the names of the tables, Loop first and ours last."""
    return {
        LOOP: loop(),
        "Flat": flat(),
        "Butterfly": modified_butterfly(),
        "Q1": q1(),
        "N1": n1(),
        "NC": nc(),
        OURS: pns(load_model()),
    }
