"""The operator: refine the selected meshes, at once or while the interface goes on."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty
from mathutils import Vector

from pns_common import PnsError

from . import live
from .animation import redirect_drivers
from .live_nodes import remove_modifier
from .losses import subdividing_modifiers
from .overlay import hide
from .run import Key, Made, Run, Share, key_of, refine_meshes
from .settings import Settings, choice_of, keeps_polygons
from .words import listed
from .writing import take_name

# Above so many faces the work goes on beside the interface, and there is no redo panel.
AT_ONCE = 60_000
# Above so many faces one is warned.
MANY = 1_000_000
# What still reaches the viewport while a run goes on.
PASSED_ON = {
    "MIDDLEMOUSE",
    "WHEELUPMOUSE",
    "WHEELDOWNMOUSE",
    "TRACKPADPAN",
    "TRACKPADZOOM",
    "MOUSEROTATE",
    "NDOF_MOTION",
    "TIMER",
}


def made_count(objects: list[bpy.types.Object], settings: Settings) -> int:
    """Return how many faces there will be, at most where that is what is asked for.

    A tolerance or an angle counts as whole levels.
    """
    if settings.detail == "FACES":
        return settings.max_faces * len(objects)
    made, whole = 0, keeps_polygons(settings)
    for obj in objects:
        corners, faces = len(obj.data.loops), len(obj.data.polygons)
        polygons = whole and not is_triangles(obj)
        made += corners if polygons else 4 * (corners - 2 * faces)
    return made * 4 ** (settings.levels - 1)


def is_triangles(obj: bpy.types.Object) -> bool:
    """Return whether all faces of an object are triangles."""
    return len(obj.data.loops) == 3 * len(obj.data.polygons)


def chosen_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the selected meshes with faces; the active one alone if nothing is selected."""
    objects = list(context.selected_objects) or [context.object]
    return [o for o in objects if o is not None and o.type == "MESH" and len(o.data.polygons)]


def leave_edit_mode(context: bpy.types.Context) -> None:
    """Go to object mode, where what was edited is the mesh."""
    if context.mode == "EDIT_MESH":
        bpy.ops.object.mode_set(mode="OBJECT")


class Refining(Settings):
    """Base of both forms of the operator."""

    keep_original: BoolProperty(
        name="Keep Original",
        description="Make new objects, and leave those that are refined as they are",
        default=True,
    )

    beside: BoolProperty(
        name="Beside",
        description="Put new objects beside the old ones, but for those that other objects move",
        default=True,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether it is object or edit mode, with some mesh that has faces."""
        if context.mode not in ("OBJECT", "EDIT_MESH"):
            cls.poll_message_set("Leave the present mode for Object or Edit Mode first")
            return False
        if not chosen_objects(context):
            cls.poll_message_set("Select a mesh with faces first")
            return False
        return True

    def draw(self, context: bpy.types.Context) -> None:
        """Show the properties, and how many faces there will be."""
        layout = self.layout
        layout.use_property_split = True
        self.draw_settings(layout)
        layout.prop(self, "keep_original")
        column = layout.column()
        column.enabled = self.keep_original
        column.prop(self, "beside")
        draw_forecast(layout, chosen_objects(context), self)

    def refused(self, context: bpy.types.Context) -> bool:
        """Return whether an object would change that its own file alone can keep; it is said."""
        if self.keep_original:
            return False
        linked = [o.name for o in chosen_objects(context) if not o.is_editable]
        if linked:
            text = f"Linked from another file, and not to be changed here: {listed(linked)}"
            self.report({"ERROR"}, f"{text}. Keep Original makes new objects")
        return bool(linked)

    def begin(self, context: bpy.types.Context) -> Run:
        """Begin a run for the selected meshes.

        Raises:
            PnsError: the model cannot be used.
        """
        leave_edit_mode(context)
        objects = chosen_objects(context)
        self.objects = [key_of(obj) for obj in objects]
        self.share = Share()
        return Run(refine_meshes(objects, choice_of(self), self.share))

    def place(self, context: bpy.types.Context, made: dict[Key, Made]) -> None:
        """Give the refined meshes to objects, and say how it went."""
        found = [bpy.data.objects.get(key) for key in self.objects]
        objects = [obj for obj in found if obj is not None]
        placed = [place(obj, made[key_of(obj.data)], self.keep_original) for obj in objects]
        if self.keep_original and self.beside:
            put_beside(placed, objects)
        if not self.keep_original:
            for refined in made.values():
                take_name(refined.mesh, refined.source)
        else:
            for obj in context.selected_objects:
                obj.select_set(False)
            for obj in placed:
                obj.select_set(True)
            if placed:
                layer = context.view_layer
                layer.objects.active = dict(zip(objects, placed, strict=True)).get(
                    layer.objects.active, placed[-1]
                )
        faces = sum(len(refined.mesh.polygons) for refined in made.values())
        self.report({"INFO"}, f"{faces:,} faces; what is kept and what not: sidebar, PNS")

    def failed(self, error: PnsError) -> set[str]:
        """Say what is wrong, and with which object."""
        place = f"{self.share.text}: " if self.share.text else ""
        self.report({"ERROR"}, f"{place}{error}")
        return {"CANCELLED"}


class OBJECT_OT_pns_refine(Refining, bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Refine the selected meshes: subdivision with a small, bounded, learned correction"""

    bl_idname = "object.pns_refine"
    bl_label = "Refine with PNS"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Refine at once what is small, and the rest beside the interface."""
        leave_edit_mode(context)
        if made_count(chosen_objects(context), self) <= AT_ONCE:
            return self.execute(context)
        chosen = {name: getattr(self, name) for name in self.as_keywords()}
        bpy.ops.object.pns_refine_large("INVOKE_DEFAULT", **chosen)
        return {"CANCELLED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Refine at once."""
        if self.refused(context):
            return {"CANCELLED"}
        try:
            run = self.begin(context)
            self.place(context, run.finish())
        except PnsError as error:
            return self.failed(error)
        return {"FINISHED"}


class OBJECT_OT_pns_refine_large(Refining, bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Refine the selected meshes beside the interface; Escape stops"""

    bl_idname = "object.pns_refine_large"
    bl_label = "Refine with PNS (Large)"
    # Not REGISTER: a redo panel would do all the work again at each change.
    bl_options = {"UNDO"}  # noqa: RUF012

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin, and come back with every tick of a timer."""
        if self.refused(context):
            return {"CANCELLED"}
        try:
            self.run = self.begin(context)
        except PnsError as error:
            return self.failed(error)
        self.timer = context.window_manager.event_timer_add(0.02, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Go on a little at each tick; Escape stops."""
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "Stopped; nothing was changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type in PASSED_ON else {"RUNNING_MODAL"}
        try:
            if not self.run.advance():
                text = f"{self.share.text}: {100 * self.share.value:.0f} %   Escape stops"
                context.workspace.status_text_set(text)
                return {"PASS_THROUGH"}
            self.place(context, self.run.value)
        except PnsError as error:
            self.end(context)
            return self.failed(error)
        except BaseException:
            self.end(context)
            raise
        self.end(context)
        return {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop, as Escape asks, or Blender when the window closes."""
        self.run.cancel()
        self.end(context)

    def end(self, context: bpy.types.Context) -> None:
        """Take away the timer and the status line."""
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)


class OBJECT_OT_pns_subsurf_off(bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Switch off the Subdivision Surface modifiers of the selected objects"""

    bl_idname = "object.pns_subsurf_off"
    bl_label = "Switch Off Subdivision Surface"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether there is such a modifier that acts."""
        return any(map(subdividing_modifiers, chosen_objects(context)))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Hide them in the viewport and in renders."""
        for obj in filter(lambda obj: obj.is_editable, chosen_objects(context)):
            for name in subdividing_modifiers(obj):
                obj.modifiers[name].show_viewport = obj.modifiers[name].show_render = False
        return {"FINISHED"}


def place(obj: bpy.types.Object, made: Made, keep_original: bool) -> bpy.types.Object:
    """Give a refined mesh to a copy of an object, or to itself; the object that has it.

    It shows that mesh: not its old one live, nor by the old one's scale.
    """
    if not keep_original:
        live.remove(obj)
        obj.data = made.mesh
        return obj
    new = obj.copy()
    new.name = f"{obj.name} refined"
    hide(new)
    remove_modifier(new)
    new.data = made.mesh
    for collection in homes_of(obj):
        collection.objects.link(new)
    redirect_drivers(made.mesh.shape_keys, obj, new)
    return new


def put_beside(new: list[bpy.types.Object], old: list[bpy.types.Object]) -> None:
    """Move new objects along x by a tenth more than the old ones are wide together.

    Those stay that others move: by a parent, a constraint or a modifier.
    """
    across = [(obj.matrix_world @ Vector(corner)).x for obj in old for corner in obj.bound_box]
    for obj in new:
        if not (obj.parent or obj.constraints or any(map(_by_another, obj.modifiers))):
            obj.location.x += 1.1 * float(np.ptp(across))


def _by_another(modifier: bpy.types.Modifier) -> bool:
    """Return whether a modifier reads another object, as an Armature or a Hook does."""
    return getattr(modifier, "object", None) is not None


def homes_of(obj: bpy.types.Object) -> list[bpy.types.Collection]:
    """Return the collections that an object is in and a copy may be too; at least the scene's."""
    own = [c for c in obj.users_collection if c.is_editable and c.override_library is None]
    return own or [bpy.context.scene.collection]


def draw_forecast(
    layout: bpy.types.UILayout, objects: list[bpy.types.Object], settings: Settings
) -> None:
    """Show how many faces there will be, whether that is wise, and what subdivides them again."""
    made = made_count(objects, settings)
    faces = sum(len(o.data.polygons) for o in objects)
    text = {
        "LEVELS": f"{made:,} faces from {faces:,}",
        "FACES": f"At most {made:,} faces, from {faces:,}",
    }.get(settings.detail, f"As many faces as that takes, from {faces:,}")
    whole = keeps_polygons(settings) and not all(map(is_triangles, objects))
    if settings.detail == "ANGLE" and whole:
        text = "Angle is for triangles: choose another Detail for quads"
    layout.label(text=text, icon="INFO")
    if made > MANY:
        text = f"More than {MANY:,} faces: this takes long, and much memory"
        layout.label(text=text, icon="ERROR")
    draw_subdivided(layout, objects)


def draw_subdivided(layout: bpy.types.UILayout, objects: list[bpy.types.Object]) -> None:
    """Show which modifiers subdivide the result again, and a button that switches them off."""
    again = sorted({name for o in objects for name in subdividing_modifiers(o)})
    if again:
        layout.label(text=f"It is subdivided again by: {listed(again)}", icon="ERROR")
        layout.operator(OBJECT_OT_pns_subsurf_off.bl_idname)
