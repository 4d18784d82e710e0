"""Fixtures of every test; those of the library alone run with its array annotations enforced too.

Shapes and kinds are checked at run time in a run over tests/library and nothing else. It takes
five times as long, and a shape does not hang on the numbers: of each test the first parameters
serve, of a property a few examples. A run over all tests takes all of both.
"""

from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

import tests.support.typecheck  # noqa: F401  (the hook finds it by name)

TESTS = Path(__file__).resolve().parent
PACKAGE = TESTS.parent / "pns_common"
# These check their own input and raise errors of their own: the edge where values come in.
FRONT_DOORS = {
    "mesh/mesh.py",
    "mesh/creases.py",
    "operator/scheme.py",
    "refinement.py",
    "parameters.py",
}
CHECKED = [
    ".".join(["pns_common", *path.relative_to(PACKAGE).with_suffix("").parts])
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.relative_to(PACKAGE).as_posix() not in FRONT_DOORS
    # Kernels are compiled from their source, and have their types from that.
    and not path.is_relative_to(PACKAGE / "kernels")
]

# Derandomised: the same examples on every machine. Timings are never asserted.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.register_profile("shapes", settings.get_profile("ci"), max_examples=2)
settings.load_profile("ci")

FIRST_ALONE = pytest.StashKey[bool]()

# Which tests are of a kind that `make quick` leaves out, by where they stand.
KINDS = {
    "spawning": (
        "addons",
        "deploy",
        "docs/test_site.py",
        "fuzz",
        "service/http",
        "service/scale",
        "service/cli",
        "service/web",
        "service/workers",
        "soak",
        "test_architecture.py",
        "test_benchmarks.py",
        "test_makefile.py",
        "test_wheel.py",
        "web",
    ),
    "training": ("export", "train"),
}

# What takes longest comes first, so that several test processes end together.
LONGEST = (
    "train/test_experiments.py",
    "library/test_kernels.py",
    "service/http/test_serve.py",
    "test_wheel.py",
    "conformance/test_conformance.py",
    "train/test_reproduce.py",
    "service/http/test_crossed_answers.py",
    "service/http/test_openapi.py",
    "soak/test_soak.py",
    "service/http/test_hostile.py",
    "service/workers/test_pool.py",
    "web/test_bundle.py",
    "docs/test_site.py",
    "train/test_adversaries.py",
    "train/test_certificates.py",
    "train/test_data.py",
    "train/test_training.py",
)


def pytest_configure(config: pytest.Config) -> None:
    """Check annotations in a run over tests of the library; nothing has imported it yet."""
    here = config.invocation_params.dir
    given = [(here / argument.partition("::")[0]).resolve() for argument in config.args]
    if given and all(path.is_relative_to(TESTS / "library") for path in given):
        install_import_hook(CHECKED, "tests.support.typecheck.check")
        settings.load_profile("shapes")
        config.stash[FIRST_ALONE] = all(path.is_dir() for path in given)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark and sort tests by where they stand; for shapes keep the first parameters of each."""
    if config.stash.get(FIRST_ALONE, False):
        first: dict[str, pytest.Item] = {}
        for item in items:
            first.setdefault(item.nodeid.partition("[")[0], item)
        kept = list(first.values())
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = kept
    ranks = {TESTS / place: rank for rank, place in enumerate(LONGEST)}
    items.sort(key=lambda item: ranks.get(item.path, len(ranks)))
    for item in items:
        for kind in kinds_of(item.path):
            item.add_marker(kind)


@cache
def kinds_of(path: Path) -> list[str]:
    """The kinds of all tests of a file."""
    return [
        kind
        for kind, places in KINDS.items()
        if any(path.is_relative_to(TESTS / place) for place in places)
    ]


@pytest.fixture
def anyio_backend() -> str:
    """Tests that are coroutines run on asyncio alone."""
    return "asyncio"
