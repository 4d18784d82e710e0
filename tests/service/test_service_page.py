"""docs/service.md names every setting."""

from pathlib import Path

import pytest

from service.settings import Settings

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text()


@pytest.mark.parametrize("name", sorted(Settings.model_fields))
def test_every_setting_is_on_the_page(name):
    assert f"`PNS_{name.upper()}`" in PAGE
