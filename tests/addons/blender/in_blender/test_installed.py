"""The zip installs, and what it registered goes without a trace."""

import sys

import bpy
import onnxruntime
import pytest
from conftest import HOME, NAME
from scene import cube

import pns_common


@pytest.mark.parametrize("package", [pns_common, onnxruntime])
def test_the_library_and_its_runtime_are_the_bundled_wheels(package):
    assert package.__file__.startswith(HOME.name)


def test_the_menu_has_the_operator():
    functions = bpy.types.VIEW3D_MT_object.draw._draw_funcs
    assert any(f.__module__.startswith(NAME) for f in functions)


def test_disabling_leaves_nothing_behind():
    before = traces()
    assert before["types"]
    cube()
    bpy.ops.object.pns_live_add()
    assert bpy.ops.preferences.addon_disable(module=NAME) == {"FINISHED"}
    try:
        assert not any(traces().values()), traces()
        bpy.context.view_layer.update()
    finally:
        bpy.ops.preferences.addon_enable(module=NAME)
    assert traces() == before


def traces():
    """Return what Blender knows of the extension."""
    handlers = [
        h
        for group in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, group), list)
        for h in getattr(bpy.app.handlers, group)
    ]
    live = sys.modules.get(f"{NAME}.live_watch")
    return {
        "types": sorted(n for n in dir(bpy.types) if "pns" in n.lower()),
        "operators": [n for n in dir(bpy.ops.object) if n.startswith("pns_")],
        "properties": [
            n for n in (p.identifier for p in bpy.types.Mesh.bl_rna.properties) if "pns" in n
        ],
        "handlers": [h.__name__ for h in handlers if h.__module__.startswith(NAME)],
        "menu": [
            f.__name__
            for f in getattr(bpy.types.VIEW3D_MT_object.draw, "_draw_funcs", ())
            if f.__module__.startswith(NAME)
        ],
        "timers": bool(live and bpy.app.timers.is_registered(live.tick)),
    }
