"""The dashboard and the alerts ask for series that the service has."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from service.http.app import create_app
from service.http.server import DrainingServer
from service.http.watch.metrics import scrapes
from service.settings import Settings
from tests.support import stand_in_jobs as jobs
from tests.support.live import local

yaml = pytest.importorskip("yaml")

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
DASHBOARD = json.loads((DEPLOY / "grafana" / "pns.json").read_text())
RULES = DEPLOY / "prometheus" / "pns.yaml"
ALERTS = [
    rule["expr"] for group in yaml.safe_load(RULES.read_text())["groups"] for rule in group["rules"]
]
QUERIES = [target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]]
SERIES = r"\b(?:pns|process)_[a-z_]+\b"


@pytest.fixture(scope="module")
def served():
    """The names and labels of all series, after a request of each kind."""
    settings = Settings(workers=1)
    app = create_app(settings, job=jobs.obey, measure=jobs.measure, warm_up=jobs.no_warm_up)
    DrainingServer(app, settings)
    with local(app) as client:
        glb = {"Content-Type": "model/gltf-binary"}
        while client.post("/subdivide", content=b"x", headers=glb).status_code != 200:
            pass
        client.get("/models")
        text = local(scrapes(app.state.metrics.registry)).get("/metrics").text
    families = list(text_string_to_metric_families(text))
    names = {sample.name: set() for family in families for sample in family.samples}
    for family in families:
        # A counter with labels shows nothing before it counts.
        if not family.samples:
            names[f"{family.name}_total"] = {"cause"}
        for sample in family.samples:
            names[sample.name] |= set(sample.labels)
    return names


@pytest.mark.parametrize("query", QUERIES + ALERTS)
def test_every_series_that_is_asked_for_is_one_of_the_service(served, query):
    named = re.findall(SERIES, query)
    # Prometheus' own, of a scrape.
    assert named or query.startswith("up{")
    for name in named:
        assert name in served, name
    for labels in re.findall(r"by \(([^)]*)\)", query):
        for label in labels.split(", "):
            assert label in served[named[0]] | {"instance"}, label
    assert query.count("(") == query.count(")")


def test_prometheus_takes_the_alerts():
    program = shutil.which("promtool")
    if program is None:
        pytest.skip("needs promtool (Debian: prometheus)")
    done = subprocess.run(
        [program, "check", "rules", RULES], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_panels_are_side_by_side():
    taken = set()
    for panel in DASHBOARD["panels"]:
        panel_place = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(panel_place["x"], panel_place["x"] + panel_place["w"])
            for y in range(panel_place["y"], panel_place["y"] + panel_place["h"])
        }
        assert panel_place["x"] + panel_place["w"] <= 24
        assert not cells & taken, panel["title"]
        taken |= cells
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(DASHBOARD["panels"])


def test_every_series_of_ours_is_on_the_dashboard_or_a_part_of_one(served):
    text = " ".join(QUERIES)
    ours = {name for name in served if name.startswith("pns_")}
    bases = {re.sub(r"_(bucket|sum|count|created|total)$", "", name) for name in ours}
    assert {base for base in bases if base not in text} == set()


def test_every_series_of_ours_is_in_the_reference_and_none_that_is_not(served):
    page = Path(__file__).resolve().parents[2] / "docs" / "reference" / "metrics.md"
    told = set(re.findall(r"`(pns_[a-z_]+)`", page.read_text()))
    ours = {name for name in served if name.startswith("pns_")}
    assert told == {re.sub(r"_(bucket|sum|count|created)$", "", name) for name in ours} - {
        # The library's own, beside each counter.
        name.removesuffix("_total")
        for name in told
        if name.endswith("_total")
    }
