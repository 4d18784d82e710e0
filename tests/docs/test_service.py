"""The reference names every setting, and shows what GET /models answers."""

import json
import re
from dataclasses import asdict
from pathlib import Path

import pytest

from pns_common import load_model
from service.errors import ServiceError
from service.http import documentation, routes  # noqa: F401  (every error's class)
from service.http.server import HEAD_BYTES
from service.http.watch.journal import GONE
from service.settings import Settings
from service.workers.catalogue import ModelEntry

ROOT = Path(__file__).resolve().parents[2]
SETTINGS, PAGE = (
    (ROOT / "docs" / "reference" / f"{name}.md").read_text() for name in ("settings", "http")
)
DOCKERFILE = (ROOT / "Dockerfile").read_text()


@pytest.mark.parametrize("name", sorted(Settings.model_fields))
def test_every_setting_is_on_the_page(name):
    assert f"`PNS_{name.upper()}`" in SETTINGS


@pytest.mark.parametrize(("name", "value"), re.findall(r"PNS_([A-Z_]+)=(\S+)", DOCKERFILE))
def test_what_the_container_has_otherwise_is_on_the_page(name, value):
    default = Settings.model_fields[name.lower()].default
    (row,) = re.findall(rf"^\|[^|]*`PNS_{name}`.*", SETTINGS, re.MULTILINE)
    container = re.findall(r"\(container: ([^)]*)\)", row)
    assert value == str(default) or value in container[0].split(", ")


def test_the_list_of_models_has_the_fields_of_the_example():
    models, _ = examples()
    assert all(set(entry) <= set(ModelEntry.model_fields) for entry in models)


def test_the_example_of_a_model_is_true_of_it():
    ((said, *_), _) = examples()
    model = load_model(said["name"])
    true = {"hash": f"{model.hash[:4]}…", "size": model.size} | asdict(model.card)
    # Of these it has the beginnings.
    assert said.pop("training").items() <= true.pop("training").items()
    assert said.pop("metrics").keys() == true.pop("metrics").keys()
    assert said.items() <= (true | {"name": model.name, "default": False}).items()


def test_the_example_of_a_job_has_the_fields_of_a_job():
    _, job = examples()
    assert set(job) == set(documentation.JOB_FIELDS)


def errors(cls=ServiceError):
    """Yield the statuses of the service's errors."""
    yield cls.status
    for kind in cls.__subclasses__():
        yield from errors(kind)


def test_every_status_of_an_error_is_on_the_page():
    listed = {
        int(status)
        for row in re.findall(r"^\| ([\d, ]+) \|", PAGE, re.MULTILINE)
        for status in row.split(",")
    }
    # 499 is of those who are gone, for the log alone.
    assert (set(errors()) | {405}) - {GONE} <= listed
    assert f"status {GONE}" in PAGE
    assert f"{HEAD_BYTES // 1024} KiB" in PAGE


def examples():
    return [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)]
