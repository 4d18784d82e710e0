"""Register the extension's classes with Blender, and unregister them."""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty

from . import live, live_operators, live_watch, operator, overlay, panel, result

CLASSES = (
    result.PNS_PG_result,
    live.PNS_PG_live,
    operator.OBJECT_OT_pns_refine,
    operator.OBJECT_OT_pns_refine_large,
    operator.OBJECT_OT_pns_subsurf_off,
    overlay.OBJECT_OT_pns_overlay,
    live_operators.OBJECT_OT_pns_live_add,
    live_operators.OBJECT_OT_pns_live_refresh,
    live_operators.OBJECT_OT_pns_live_apply,
    live_operators.OBJECT_OT_pns_live_remove,
    panel.VIEW3D_PT_pns,
    panel.VIEW3D_PT_pns_report,
    panel.VIEW3D_PT_pns_overlay,
    panel.VIEW3D_PT_pns_live,
)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)
HANDLERS = (
    ("depsgraph_update_post", live_watch.after_update),
    ("undo_pre", live_watch.before_undo),
    ("redo_pre", live_watch.before_undo),
    ("undo_post", live_watch.after_undo),
    ("redo_post", live_watch.after_undo),
    ("save_pre", live_watch.before_save),
    ("load_pre", live_watch.before_load),
    ("render_init", live_watch.before_render),
    ("render_complete", live_watch.after_render),
    ("render_cancel", live_watch.after_render),
)


def register() -> None:
    """Register everything."""
    register_classes()
    bpy.types.Mesh.pns_result = PointerProperty(type=result.PNS_PG_result)
    bpy.types.Mesh.pns_live = PointerProperty(type=live.PNS_PG_live)
    bpy.types.VIEW3D_MT_object.append(panel.draw_menu)
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    """Take everything back, in the opposite order."""
    live_watch.WATCH.clear()
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    bpy.types.VIEW3D_MT_object.remove(panel.draw_menu)
    del bpy.types.Mesh.pns_live
    del bpy.types.Mesh.pns_result
    unregister_classes()
