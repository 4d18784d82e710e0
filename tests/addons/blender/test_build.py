"""The extension's manifest, and what is packed with it."""

import tomllib

from addons.blender.build import CORE, REQUIRED, SOURCE, clean_copy, with_wheels
from tests.support.installed import ROOT

MANIFEST = (SOURCE / "blender_manifest.toml").read_text()


def test_the_manifest_is_what_blender_asks_for():
    manifest = tomllib.loads(MANIFEST)
    assert manifest["schema_version"] == "1.0.0"
    assert manifest["id"] == SOURCE.name
    assert manifest["blender_version_min"] == "4.5.0"
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    (reason,) = [manifest["permissions"].pop("files"), *manifest["permissions"].values()]
    assert len(reason) <= 64
    assert not reason.endswith(".")
    assert "blender" not in manifest["name"].lower()
    assert len(manifest["tagline"]) <= 64
    assert not manifest["tagline"].endswith(".")


def test_the_licence_is_beside_the_sources():
    assert "GNU GENERAL PUBLIC LICENSE" in (SOURCE / "LICENSE").read_text()


def test_wheels_are_listed_in_the_manifest():
    manifest = tomllib.loads(with_wheels(MANIFEST, ["a.whl", "b.whl"], "linux-x64"))
    assert manifest["wheels"] == ["./wheels/a.whl", "./wheels/b.whl"]
    assert manifest["platforms"] == ["linux-x64"]


def test_what_is_bundled_is_what_the_library_needs():
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    # Blender has numpy; bundled models are read without onnx.
    names = {line.split(">")[0] for line in needed} - {"numpy", "onnx"}
    # wadler-lindig is jaxtyping's own.
    assert set(REQUIRED) == names | {"wadler-lindig"}


def test_the_library_alone_is_described_as_the_whole_describes_it():
    whole = tomllib.loads((ROOT / "pyproject.toml").read_text())
    core = tomllib.loads(CORE.read_text())
    assert core["build-system"] == whole["build-system"]
    for key in ("dependencies", "dynamic", "license", "license-files", "requires-python"):
        assert core["project"][key] == whole["project"][key]
    tools, ours = whole["tool"]["setuptools"], core["tool"]["setuptools"]
    assert ours["dynamic"] == tools["dynamic"]
    assert ours["package-data"] == {"pns_common": tools["package-data"]["pns_common"]}


def test_builds_leave_nothing_in_the_copy(tmp_path):
    copy = clean_copy(tmp_path / "copy")
    assert (copy / "pns_common" / "refinement.py").is_file()
    assert not list(copy.rglob("__pycache__"))
    assert not (copy / "build").exists()
