"""Figures of a quarter of their size, for tests that look at what experiments write."""

from collections.abc import Iterator

import pytest

from train.experiments.harness import render, reproduce, style


@pytest.fixture(scope="module")
def small_figures() -> Iterator[None]:
    """As PNG alone, with few points: that there is a PDF too is a claim of test_reproduce.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduce, "FORMATS", {"png": reproduce.FORMATS["png"]})
        patch.setattr(style, "STYLE", {**style.STYLE, "savefig.dpi": 40})
        patch.setattr(render, "WIDTH", render.WIDTH // 4)
        patch.setattr(render, "HEIGHT", render.HEIGHT // 4)
        yield
