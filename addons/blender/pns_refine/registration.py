"""What Blender is told of, and what it is told to forget."""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty

from . import live, live_operators, operator, overlay, panel, result

CLASSES = (
    result.PNS_PG_result,
    live.PNS_PG_live,
    operator.OBJECT_OT_pns_refine,
    operator.OBJECT_OT_pns_refine_large,
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


def register() -> None:
    """Register everything."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Mesh.pns_result = PointerProperty(type=result.PNS_PG_result)
    bpy.types.Mesh.pns_live = PointerProperty(type=live.PNS_PG_live)
    bpy.types.VIEW3D_MT_object.append(panel.draw_menu)
    bpy.app.handlers.depsgraph_update_post.append(live.after_update)
    bpy.app.handlers.load_pre.append(live.after_load)


def unregister() -> None:
    """Take everything back, in the opposite order."""
    live.WATCH.clear()
    bpy.app.handlers.load_pre.remove(live.after_load)
    bpy.app.handlers.depsgraph_update_post.remove(live.after_update)
    bpy.types.VIEW3D_MT_object.remove(panel.draw_menu)
    del bpy.types.Mesh.pns_live
    del bpy.types.Mesh.pns_result
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
