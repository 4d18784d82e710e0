"""The hero figure's panels, as files for a renderer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from train.experiments.harness.laboratory import SMALL, Laboratory
from train.experiments.harness.style import TITLES
from train.experiments.paper.hero_panels import write_panels
from train.experiments.paper.methods import hard_instance


@pytest.mark.training
def test_a_column_for_each_method_and_a_row_for_one_step_and_all(tmp_path: Path) -> None:
    folder = tmp_path / "panels"
    write_panels(Laboratory(SMALL, tmp_path / "networks", None, None, lambda *_: None), folder)
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["1-1.npz", *(f"{row}-{column}.npz" for row in (1, 2) for column in (2, 3, 4))]
    control = len(hard_instance().mesh.faces)
    for column, method in enumerate(("loop", "pns", "unconstrained"), start=2):
        for row, steps in ((1, 1), (2, SMALL.levels)):
            with np.load(folder / f"{row}-{column}.npz") as panel:
                assert panel["title"] == TITLES[method]
                assert len(panel["faces"]) == control * 4**steps
                assert panel["distance"].shape == (len(panel["vertices"]),)
                assert panel["distance"].min() >= 0
                # Loop is no distance from itself.
                assert ("ratio 0.00" in str(panel["note"])) == (method == "loop")
