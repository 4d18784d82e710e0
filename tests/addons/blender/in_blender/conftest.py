"""The extension as strangers have it: installed from its zip into a Blender of its own."""

import os
import tempfile

import pytest

# Before Blender starts: nothing of the user's is read, and nothing is written there.
HOME = tempfile.TemporaryDirectory(prefix="pns-blender-")
os.environ["BLENDER_USER_RESOURCES"] = HOME.name

import bpy  # noqa: E402

NAME = "bl_ext.user_default.pns_refine"


def pytest_configure() -> None:
    """Install and enable it, before tests import what it brings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        repo="user_default", filepath=os.environ["PNS_ADDON"], enable_on_install=True
    )
    assert NAME in bpy.context.preferences.addons


@pytest.fixture(autouse=True)
def empty() -> None:
    """A file with nothing in it, before each test; the extension stays enabled."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    if NAME not in bpy.context.preferences.addons:
        bpy.ops.preferences.addon_enable(module=NAME)
