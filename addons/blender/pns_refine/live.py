"""Live mode: the base mesh stays editable, and a modifier shows its refined copy.

Settings and the copy belong to the mesh, so objects that share a mesh share them. The copy is an
object in no scene. A duplicate of the mesh shows the same copy until it is refreshed, and then gets
its own.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Generator
from dataclasses import astuple

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.props import BoolProperty, PointerProperty, StringProperty

from pns_common import PnsError

from .live_nodes import add_modifier, modifier_of, point_at, remove_modifier
from .overlay import hide
from .reading import read_mesh
from .run import Made, Run, Share, refine_mesh
from .settings import Settings, choice_of
from .writing import take_name

# How long a mesh must be left alone before it is refined again, and how often that is looked at.
QUIET, TICK = 0.3, 0.02


class PNS_PG_live(Settings, bpy.types.PropertyGroup):  # noqa: N801 (Blender's names)
    """Live mode of a mesh: what is asked for, and the result that is shown."""

    enabled: BoolProperty()
    automatic: BoolProperty(
        name="Automatic", description="Refresh after each edit of the mesh", default=True
    )
    cache: PointerProperty(type=bpy.types.Object)
    digest: StringProperty()
    problem: StringProperty()


def users_of(mesh: bpy.types.Mesh) -> list[bpy.types.Object]:
    """Return the objects that show a mesh live."""
    return [o for o in bpy.data.objects if o.data == mesh and modifier_of(o) is not None]


def enable(obj: bpy.types.Object) -> None:
    """Show an object's mesh live; objects that share the mesh are not touched."""
    obj.data.pns_live.enabled = True
    add_modifier(obj)


def refreshed(obj: bpy.types.Object, share: Share) -> Generator[object, None, bool]:
    """Refine an object's mesh again if it, or what is asked for, has changed; whether it had.

    Raises:
        PnsError: the mesh cannot be refined.
    """
    mesh: bpy.types.Mesh = obj.data
    live = mesh.pns_live
    if obj.mode == "EDIT":
        obj.update_from_editmode()
    digest = yield from _digest(mesh)
    if digest == live.digest and live.cache is not None and not _borrowed(mesh):
        _point(mesh, live.cache)
        return False
    made: Made = yield from refine_mesh(obj, choice_of(live), share)
    new = made.mesh
    new.name = f".{mesh.name} refined"
    for name in ("enabled", "cache", "digest"):
        new.pns_live.property_unset(name)
    old, cache = None, live.cache
    if cache is None or _borrowed(mesh):
        cache = bpy.data.objects.new(f".{mesh.name} live", new)
    else:
        old, cache.data = cache.data, new
    live.cache, live.digest, live.problem = cache, digest, ""
    if old is not None and old.users == 0:
        bpy.data.meshes.remove(old)
    _point(mesh, cache)
    return True


def apply(obj: bpy.types.Object) -> None:
    """Give the object the refined mesh for good; others that share the mesh stay as they are."""
    mesh: bpy.types.Mesh = obj.data
    result = mesh.pns_live.cache.data.copy()
    hide(obj)
    remove_modifier(obj)
    obj.data = result
    _forget(mesh)
    result.name = mesh.name
    take_name(result, mesh)


def remove(obj: bpy.types.Object) -> None:
    """Show the base mesh again."""
    hide(obj)
    remove_modifier(obj)
    _forget(obj.data)


def _forget(mesh: bpy.types.Mesh) -> None:
    """Drop a mesh's live result when no object shows it any more."""
    if users_of(mesh):
        return
    cache, borrowed = mesh.pns_live.cache, _borrowed(mesh)
    for name in ("enabled", "cache", "digest", "problem"):
        mesh.pns_live.property_unset(name)
    if cache is not None and not borrowed:
        result = cache.data
        bpy.data.objects.remove(cache)
        if result.users == 0:
            bpy.data.meshes.remove(result)


def _borrowed(mesh: bpy.types.Mesh) -> bool:
    """Return whether another mesh has the same result, as after duplication."""
    cache = mesh.pns_live.cache
    return cache is not None and any(
        other != mesh and other.pns_live.cache == cache for other in bpy.data.meshes
    )


def _point(mesh: bpy.types.Mesh, cache: bpy.types.Object) -> None:
    for obj in users_of(mesh):
        point_at(obj, cache)


def _digest(mesh: bpy.types.Mesh) -> Generator[None, None, str]:
    """Return a text that changes when the mesh changes, or what is asked for."""
    reading = yield from read_mesh(mesh)
    digest = hashlib.blake2b(digest_size=16)
    snapshot, live = reading.snapshot, mesh.pns_live
    for layer in snapshot.layers:
        digest.update(repr((layer.name, layer.kind, layer.domain, layer.names)).encode())
        digest.update(np.ascontiguousarray(layer.values))
    for array in (
        snapshot.points,
        snapshot.triangles,
        snapshot.edges,
        snapshot.crease_sharpness,
        snapshot.groups,
    ):
        digest.update(np.ascontiguousarray(array))
    materials = [None if material is None else material.name for material in mesh.materials]
    groups = [astuple(group) for group in reading.groups]
    asked = [getattr(live, name) for name in Settings.__annotations__]
    digest.update(repr((materials, groups, asked)).encode())
    return digest.hexdigest()


class Watch:
    """Meshes that changed, and the run that refreshes one of them; kept while Blender runs."""

    def __init__(self) -> None:
        self.changed: dict[int, float] = {}
        self.run: Run | None = None
        self.at: int | None = None

    def note(self, mesh: bpy.types.Mesh) -> None:
        """Note that a mesh has changed, now."""
        self.changed[mesh.session_uid] = time.monotonic()
        if not bpy.app.timers.is_registered(tick):
            bpy.app.timers.register(tick, first_interval=QUIET)

    def clear(self) -> None:
        """Forget everything: another file is open, or the extension goes."""
        if self.run is not None:
            self.run.cancel()
        self.changed, self.run, self.at = {}, None, None
        if bpy.app.timers.is_registered(tick):
            bpy.app.timers.unregister(tick)

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
        return TICK

    def _go_on(self) -> None:
        obj = _object_of(self.at)
        if obj is None:
            self.run.cancel()
            self.run = None
            return
        try:
            if self.run.advance():
                self.run = None
        except PnsError as error:
            obj.data.pns_live.problem = str(error)
            self.run = None


WATCH = Watch()


def _object_of(uid: int | None) -> bpy.types.Object | None:
    """Return some object that shows the mesh of this number live; None where it is gone."""
    for mesh in bpy.data.meshes:
        if mesh.session_uid == uid and mesh.pns_live.enabled:
            return next(iter(users_of(mesh)), None)
    return None


def tick() -> float | None:
    """Advance the watch, as Blender's timer asks."""
    return WATCH.advance()


@persistent
def after_update(scene: bpy.types.Scene, graph: bpy.types.Depsgraph) -> None:
    """Note the meshes that an edit has changed."""
    for update in graph.updates:
        if not update.is_updated_geometry:
            continue
        changed = update.id.original
        mesh = changed.data if isinstance(changed, bpy.types.Object) else changed
        if isinstance(mesh, bpy.types.Mesh) and mesh.pns_live.enabled and mesh.pns_live.automatic:
            WATCH.note(mesh)


@persistent
def after_load(*_: object) -> None:
    """Forget the file that was open before."""
    WATCH.clear()
