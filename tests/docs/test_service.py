"""docs/service.md names every setting, and shows what GET /models answers."""

import json
import re
from pathlib import Path

import pytest

from service.http import documentation
from service.settings import Settings
from service.workers.catalogue import ModelEntry

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text()


@pytest.mark.parametrize("name", sorted(Settings.model_fields))
def test_every_setting_is_on_the_page(name):
    assert f"`PNS_{name.upper()}`" in PAGE


def test_the_list_of_models_has_the_fields_of_the_example():
    models, _ = examples()
    assert [set(entry) for entry in models] == [set(ModelEntry.model_fields)]


def test_the_example_of_a_job_has_the_fields_of_a_job():
    _, job = examples()
    assert set(job) == set(documentation.JOB_FIELDS)


def examples():
    return [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)]
