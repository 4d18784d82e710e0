"""docs/service.md names every setting, and shows what GET /models answers."""

import json
import re
from pathlib import Path

import pytest

from service.catalogue import ModelEntry
from service.settings import Settings

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text()


@pytest.mark.parametrize("name", sorted(Settings.model_fields))
def test_every_setting_is_on_the_page(name):
    assert f"`PNS_{name.upper()}`" in PAGE


def test_the_list_of_models_has_the_fields_of_the_example():
    (example,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    assert [set(entry) for entry in json.loads(example)] == [set(ModelEntry.model_fields)]
