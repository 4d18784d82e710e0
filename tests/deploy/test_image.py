"""The image is made of what is pinned, and says what it is made of."""

import re
from pathlib import Path

import pytest
from fsspec.registry import known_implementations

from service.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
DOCKERFILE = (ROOT / "Dockerfile").read_text()
PROJECT = (ROOT / "pyproject.toml").read_text()
REQUIREMENTS = [ROOT / "requirements" / f"{name}.txt" for name in ("service", "build", "meshopt")]


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(path):
    """Name and version of each requirement."""
    pinned = re.findall(r"^([A-Za-z0-9._-]+)==(\S+)", path.read_text(), re.MULTILINE)
    return {normal(name): version for name, version in pinned}


@pytest.mark.parametrize("path", REQUIREMENTS, ids=lambda path: path.stem)
def test_everything_has_hashes(path):
    text = re.sub(r"\\\n", " ", path.read_text())
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert lines
    for line in lines:
        assert re.match(r"[a-z0-9._-]+==\S+ ( *--hash=sha256:[0-9a-f]{64})+ *$", line), line[:80]


def test_what_is_installed_is_what_the_service_names_and_the_tests_ran_with():
    installed = pins(REQUIREMENTS[0]) | pins(REQUIREMENTS[2])
    assert installed.items() <= pins(ROOT / "constraints.txt").items()
    for table in ("dependencies", "service", "tracing"):
        (block,) = re.findall(rf"^{table} = \[\s*(.*?)\]$", PROJECT, re.MULTILINE | re.DOTALL)
        named = {normal(name) for name in re.findall(r'"([A-Za-z0-9._-]+)', block)}
        assert named - {"pns-subdivision"} <= set(installed)


@pytest.mark.parametrize(("extra", "protocol"), [("s3", "s3"), ("gcs", "gs"), ("azure", "abfs")])
def test_each_extra_of_a_store_installs_what_its_urls_are_opened_by(extra, protocol):
    (package,) = re.findall(rf'^{extra} = \["([a-z0-9]+)', PROJECT, re.MULTILINE)
    assert known_implementations[protocol]["class"].partition(".")[0] == package


def test_nothing_is_installed_without_a_hash_on_a_base_that_is_named_by_digest():
    installs = re.findall(r"pip install[^&\n]*", DOCKERFILE)
    assert len(installs) == 3
    for install in installs:
        assert "--require-hashes" in install or "--no-index" in install, install
    (python, again), (proxy,) = (
        re.findall(r"^FROM (\S+)", path.read_text(), re.MULTILINE)
        for path in (ROOT / "Dockerfile", ROOT / "deploy" / "proxy" / "Dockerfile")
    )
    assert python == again
    assert re.fullmatch(r"python:3\.13\.\d+-slim-bookworm@sha256:[0-9a-f]{64}", python)
    assert re.fullmatch(r"debian:bookworm-slim@sha256:[0-9a-f]{64}", proxy)


def test_the_image_says_what_it_is_made_of_and_its_settings_are_settings():
    assert "cyclonedx-py environment" in DOCKERFILE
    assert "sha256sum --check --strict SHA256SUMS" in DOCKERFILE
    names = set(re.findall(r"PNS_([A-Z_]+)", DOCKERFILE))
    assert {name.lower() for name in names} <= set(Settings.model_fields)
