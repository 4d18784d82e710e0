"""Objects that are shown live, and what Blender's timer does with them."""

import bpy
from bl_ext.user_default.pns_refine.live_watch import WATCH
from scene import chosen, evaluated, points_of


def started(obj, **settings):
    """The object, live, with these settings."""
    chosen(obj)
    assert bpy.ops.object.pns_live_add() == {"FINISHED"}
    for name, value in settings.items():
        setattr(obj.data.pns_live, name, value)
    if settings:
        bpy.ops.object.pns_live_refresh()
    return obj


def shown(obj):
    """The vertices that are shown."""
    return points_of(evaluated(obj))


def shown_mesh(obj):
    """The mesh that is shown, as it stands in the file."""
    return obj.data.pns_live.cache.data


def settle():
    """Run at once what Blender's timer does in the seconds after an edit."""
    bpy.context.view_layer.update()
    for _ in range(100):
        if WATCH.run is not None:
            WATCH.run.finish()
        if WATCH.advance(quiet=0) is None:
            return
    raise AssertionError("it never settles")
