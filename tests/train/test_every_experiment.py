"""Every experiment runs from end to end, at a scale of seconds where no number means anything."""

import pytest

from tests.support.experiments import assert_written
from tests.support.shared import shared_path
from train.certificates import displacement
from train.experiments.harness.laboratory import SMALL, Laboratory
from train.experiments.harness.reproduce import reproduce
from train.experiments.registry import EXPERIMENTS

pytestmark = pytest.mark.usefixtures("small_figures")

NAMES = (
    "structural, spectral, ablation, headline, cross-section, repeated, c-sweep, budget, capacity, "
    "saddle, sphere-ridge, extended, models, validation, whole-meshes, spheres, fresh-ridges, "
    "fairness, shading, hero, "
    "published"
)


@pytest.fixture(scope="module", autouse=True)
def shallow_certificates():
    """One level of T1: that it looks at each is a claim of test_certificates.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(displacement, "LARGEST", 0)
        yield


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


def laboratory_for(experiment, output):
    published = shared_path("published") if experiment.needs_published else None
    assets = shared_path("assets") if experiment.needs_assets else None
    networks = output / "cache" / "networks"
    return Laboratory(SMALL, networks, None, published, lambda *_: None, assets)


def test_there_is_an_experiment_for_each_table_and_figure():
    assert set(EXPERIMENTS) == set(NAMES.split(", "))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_writes_its_tables_and_figures(name, output):
    experiment = EXPERIMENTS[name]
    record = reproduce(experiment, laboratory_for(experiment, output), output)
    assert_written(record, output, name)


def test_ratios_of_pns_never_pass_one(output):
    experiment = EXPERIMENTS["c-sweep"]
    table = reproduce(experiment, laboratory_for(experiment, output), output).tables[0]
    column = [column.name for column in table.columns].index("max_ratio")
    for row in table.rows:
        assert 0 < row[column] <= 1 + 1e-12
