"""Refreshes of live mode: a while after an edit, and again after undo.

What undo steps do not know of is put away before undo, and found again afterwards.
"""

from __future__ import annotations

import time

import bpy
from bpy.app.handlers import persistent

from pns_common import PnsError

from .live import (
    empty,
    live_meshes,
    paint,
    point,
    refreshed,
    show_again,
    show_for_render,
    shown_of,
    take_away_cache,
    users_of,
)
from .live_nodes import modifier_of, point_at, result_of
from .run import Run, Share

# How long a mesh must be left alone before it is refined again, and how often that is looked at.
QUIET, TICK = 0.3, 0.02


class Watch:
    """Meshes that changed, and the run that refreshes one of them; kept while Blender runs.

    Meshes have numbers here, as blocks may be gone at any tick. ``young`` are those whose copy was
    made by a tick, and not by an operator with a step of undo.
    """

    def __init__(self) -> None:
        self.changed: dict[int, float] = {}
        self.young: set[int] = set()
        self.run: Run | None = None
        self.at: int | None = None
        self._cache: int | None = None

    def note(self, mesh: bpy.types.Mesh) -> None:
        """Note that a mesh has changed, now, if not by being read."""
        if self.run is not None and self.run.busy and self.at == mesh.session_uid:
            return
        self.changed[mesh.session_uid] = time.monotonic()
        if not bpy.app.timers.is_registered(tick):
            bpy.app.timers.register(tick, first_interval=QUIET)

    def clear(self) -> None:
        """Forget everything: another file is open, or the extension goes."""
        if self.run is not None:
            self.run.cancel()
        self.changed, self.young, self.run, self.at = {}, set(), None, None
        if bpy.app.timers.is_registered(tick):
            bpy.app.timers.unregister(tick)

    def pause(self) -> None:
        """Stop the run, and begin it again when there is time."""
        if self.run is not None:
            self._end()
            self.changed.setdefault(self.at, time.monotonic())

    def advance(self, quiet: float = QUIET) -> float | None:
        """Go on with the refreshing; seconds until it wants to be called again, None if never."""
        if self.run is not None:
            self._go_on()
            return TICK
        now = time.monotonic()
        due = [uid for uid, since in self.changed.items() if now - since >= quiet]
        if not due:
            return TICK if self.changed else None
        del self.changed[due[0]]
        obj = _object_of(due[0])
        # It may have been switched off since.
        if obj is not None and obj.data.pns_live.automatic:
            self.run, self.at = Run(refreshed(obj, Share())), due[0]
            self._cache = _cache_of(obj.data)
        return TICK

    def _go_on(self) -> None:
        obj = _object_of(self.at)
        if obj is None:
            self._end()
            return
        try:
            if self.run.advance():
                self._end()
        except PnsError as error:
            obj.data.pns_live.problem = str(error)
            self._end()
        except BaseException:
            self._end()
            raise

    def _end(self) -> None:
        self.run.cancel()
        self.run = None
        mesh = _mesh_of(self.at)
        if mesh is not None and _cache_of(mesh) != self._cache:
            self.young.add(self.at)


WATCH = Watch()


def _object_of(uid: int | None) -> bpy.types.Object | None:
    """Return some object that shows the mesh of this number live; None where it is gone."""
    mesh = _mesh_of(uid)
    return None if mesh is None else next(iter(users_of(mesh)), None)


def _mesh_of(uid: int | None) -> bpy.types.Mesh | None:
    return next((mesh for mesh in live_meshes() if mesh.session_uid == uid), None)


def _cache_of(mesh: bpy.types.Mesh) -> int | None:
    cache = mesh.pns_live.cache
    return None if cache is None else cache.session_uid


def tick() -> float | None:
    """Advance the watch, as Blender's timer asks."""
    return WATCH.advance()


@persistent
def after_update(scene: bpy.types.Scene, graph: bpy.types.Depsgraph) -> None:
    """Note the meshes that an edit has changed; a pose changes objects alone."""
    for update in graph.updates:
        mesh = update.id.original
        if update.is_updated_geometry and isinstance(mesh, bpy.types.Mesh) and _is_followed(mesh):
            WATCH.note(mesh)


@persistent
def before_undo(*_: object) -> None:
    """Refer to nothing that undo might free: blocks younger than the step, and their materials."""
    WATCH.pause()
    for mesh in live_meshes():
        if mesh.session_uid in WATCH.young:
            for obj in users_of(mesh):
                point_at(obj, None)
            take_away_cache(mesh)
        for result in (mesh.pns_live.first, mesh.pns_live.second):
            if result is not None:
                paint(result, ())
                if result.shape_keys is not None:
                    empty(result)
    WATCH.young.clear()


@persistent
def after_undo(*_: object) -> None:
    """Show the copies again, and look whether they are those of the meshes as they are now."""
    for mesh in live_meshes():
        live = mesh.pns_live
        if live.cache is not None:
            if not shown_of(live).pns_result.digest:
                empty(shown_of(live))
            paint(shown_of(live), mesh.materials)
            point(mesh)
        if live.automatic:
            WATCH.note(mesh)


@persistent
def before_render(*_: object) -> None:
    """Show every mesh as often refined as renders ask for."""
    WATCH.pause()
    for mesh in live_meshes():
        try:
            show_for_render(mesh)
        except PnsError as error:
            mesh.pns_live.problem = str(error)


@persistent
def after_render(*_: object) -> None:
    """Show every mesh as the viewport has it."""
    for mesh in live_meshes():
        show_again(mesh)


def _is_followed(mesh: bpy.types.Mesh) -> bool:
    return mesh.is_editable and mesh.pns_live.enabled and mesh.pns_live.automatic


@persistent
def before_save(*_: object) -> None:
    """Let no half of a result be saved, and no copy that nothing shows.

    A modifier may have been removed by hand; a copy that is not automatic would not come back by
    undo.
    """
    WATCH.pause()
    modifiers = filter(None, map(modifier_of, bpy.data.objects))
    shown = [result_of(modifier.node_group) for modifier in modifiers]
    for mesh in live_meshes():
        if mesh.pns_live.automatic and mesh.pns_live.cache not in shown:
            take_away_cache(mesh)


@persistent
def before_load(*_: object) -> None:
    """Forget the file that was open before."""
    WATCH.clear()
