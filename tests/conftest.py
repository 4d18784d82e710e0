"""Every test runs with the operator's array annotations enforced: shapes, kinds and all."""

from pathlib import Path

from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401  (the hook finds it by name)

PACKAGE = Path(__file__).resolve().parents[1] / "pns_common"
# These check their own input and raise errors of their own: the edge where values come in.
FRONT_DOORS = {"mesh", "refine", "parameters"}
CHECKED = [
    f"pns_common.{path.stem}" for path in PACKAGE.glob("*.py") if path.stem not in FRONT_DOORS
]

# Must come before anything imports pns_common.
install_import_hook(CHECKED, "tests.typecheck.check")

# Derandomised: the same examples on every machine. Timings are never asserted.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.load_profile("ci")
