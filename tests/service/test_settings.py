"""Every setting: from the environment, from the constructor, and within its range."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from service.settings import Settings

EXAMPLES = {
    "host": ("0.0.0.0", "0.0.0.0"),
    "port": ("8080", 8080),
    "model": ("/models/mine.onnx", "/models/mine.onnx"),
    "body": ("8MiB", 8 * 2**20),
    "faces": ("1000", 1000),
    "levels": ("3", 3),
    "memory": ("2GiB", 2 * 2**30),
    "json_items": ("500", 500),
    "workers": ("3", 3),
    "queue": ("0", 0),
    "uploads": ("7", 7),
    "job_seconds": ("7.5", 7.5),
    "upload_seconds": ("20", 20),
    "idle_seconds": ("2.5", 2.5),
    "stall_seconds": ("5", 5),
    "drain_seconds": ("9", 9),
}


def test_every_setting_has_an_example_here() -> None:
    assert set(EXAMPLES) == set(Settings.model_fields)


@pytest.mark.parametrize("name", EXAMPLES)
def test_read_from_the_environment(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text, value = EXAMPLES[name]
    monkeypatch.setenv(f"PNS_{name.upper()}", text)
    assert getattr(Settings(), name) == value


def test_the_documented_limits_are_the_defaults() -> None:
    settings = Settings()
    assert settings.body == 64 * 2**20
    assert settings.faces == 5_000_000
    assert settings.levels == 6
    assert settings.job_seconds == 60
    assert settings.host == "127.0.0.1"
    assert settings.port == 8000


def test_job_limits_are_the_settings() -> None:
    limits = Settings(faces=10, memory=20, json_items=30).job_limits()
    assert (limits.max_faces, limits.max_memory_bytes, limits.max_json_items) == (10, 20, 30)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", 65536),
        ("body", 0),
        ("body", "large"),
        ("faces", 0),
        ("levels", 0),
        ("levels", 7),
        ("memory", -1),
        ("json_items", 0),
        ("workers", 0),
        ("queue", -1),
        ("uploads", 0),
        ("idle_seconds", 0),
        ("job_seconds", 0),
        ("upload_seconds", -1),
        ("stall_seconds", 0),
        ("drain_seconds", 0),
        ("bodies", 1),
    ],
)
def test_out_of_range_is_refused(name: str, value: object) -> None:
    with pytest.raises(ValidationError, match=name):
        Settings(**{name: value})


def test_settings_do_not_change() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        Settings().port = 1
