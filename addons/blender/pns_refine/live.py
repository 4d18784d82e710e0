"""Live mode: the base mesh stays editable, and a modifier shows its refined copy.

Settings and the copy belong to the mesh, so objects that share a mesh share them. The copy is an
object in no scene. A duplicate of the mesh shows the same copy until it changes, and then gets
its own.

A refresh comes when nobody has pressed anything, so no step of undo knows of it. Undo keeps blocks
that are the same in two steps as they are now, and they must not refer to younger blocks, which it
frees. So a copy has two meshes from the start, which it shows in turn: one is written while the
other is shown. Each says itself what it was made from (``digest``).
"""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, replace

import bpy
import numpy as np
from bpy.props import BoolProperty, IntProperty, PointerProperty, StringProperty

from .live_nodes import modifier_of, point_at, remove_modifier
from .overlay import hide, rescale
from .reading import Reading, read_mesh
from .run import Made, Run, Share, refine_mesh
from .settings import Settings, choice_of
from .writing import CACHE, CARRIER, LIVE, copied, take_name


class PNS_PG_live(Settings, bpy.types.PropertyGroup):  # noqa: N801 (Blender's names)
    """Live mode of a mesh: what is asked for, and the result that is shown."""

    enabled: BoolProperty()
    automatic: BoolProperty(
        name="Automatic", description="Refresh after each edit of the mesh", default=True
    )
    render_levels: IntProperty(
        name="Render Levels",
        description="How often each face is cut when a picture is rendered",
        default=2,
        min=1,
        max=6,
    )
    cache: PointerProperty(type=bpy.types.Object)
    spare: PointerProperty(type=bpy.types.Object)
    first: PointerProperty(type=bpy.types.Mesh)
    second: PointerProperty(type=bpy.types.Mesh)
    problem: StringProperty()


def users_of(mesh: bpy.types.Mesh) -> list[bpy.types.Object]:
    """Return the objects that show a mesh live."""
    return [o for o in bpy.data.objects if o.data == mesh and modifier_of(o) is not None]


def live_meshes() -> list[bpy.types.Mesh]:
    """Return the meshes of this file that are shown live."""
    return [mesh for mesh in bpy.data.meshes if mesh.pns_live.enabled and mesh.is_editable]


def refreshed(obj: bpy.types.Object, share: Share) -> Generator[object, None, bool]:
    """Refine an object's mesh again if it, or what is asked for, has changed; whether it had.

    Raises:
        PnsError: the mesh cannot be refined.
    """
    mesh: bpy.types.Mesh = obj.data
    if mesh.is_editmode:
        _read_edits(obj)
    with _as_it_is(obj) as still:
        return (yield from _refreshed(mesh, still, share))


def _refreshed(
    mesh: bpy.types.Mesh, still: bpy.types.Object, share: Share
) -> Generator[object, None, bool]:
    live = mesh.pns_live
    # Its object may have the modifier of another.
    live.enabled = True
    reading: Reading = yield from read_mesh(still.data)
    digest = _digest(still.data, reading, live)
    whole = all(getattr(live, name) is not None for name in CACHE)
    if not whole or (_borrowed(mesh) and shown_of(live).pns_result.digest != digest):
        _make_cache(mesh)
    _keep_out_of_scenes(live)
    changed = shown_of(live).pns_result.digest != digest
    if changed:
        before, spare = shown_of(live), _spare_of(live)
        made: Made = yield from refine_mesh(still, choice_of(live), share, 0, 1, spare, reading)
        follow(made.mesh.shape_keys, mesh.shape_keys)
        made.mesh.pns_result.digest = digest
        live.cache.data, live.spare.data = made.mesh, before
        empty(before)
    live.problem = ""
    point(mesh)
    return changed


def show_for_render(mesh: bpy.types.Mesh) -> None:
    """Show a mesh refined as often as renders ask for, until ``show_again``.

    Raises:
        PnsError: the mesh cannot be refined.
    """
    live = mesh.pns_live
    obj = next(iter(users_of(mesh)), None)
    if obj is None or live.cache is None or live.render_levels == live.levels:
        return
    choice = replace(choice_of(live), levels=live.render_levels)
    with _as_it_is(obj) as still:
        made: Made = Run(refine_mesh(still, choice, Share(), into=_spare_of(live))).finish()
    follow(made.mesh.shape_keys, mesh.shape_keys)
    live.cache.data, live.spare.data = made.mesh, live.cache.data


def show_again(mesh: bpy.types.Mesh) -> None:
    """Show what the viewport shows: of both results the one that says what it was made from."""
    live = mesh.pns_live
    if live.cache is not None and not shown_of(live).pns_result.digest:
        live.cache.data, live.spare.data = live.spare.data, live.cache.data
        empty(live.spare.data)


def follow(result: bpy.types.Key | None, base: bpy.types.Key | None) -> None:
    """Let a result's shape keys have the values of its base's, at any time."""
    if result is None or base is None:
        return
    paths = [
        (block, "value", f'key_blocks["{bpy.utils.escape_identifier(block.name)}"].value')
        for block in result.key_blocks
    ]
    for owner, name, path in [*paths, (result, "eval_time", "eval_time")]:
        driver = owner.driver_add(name).driver
        driver.type = "SUM"
        variable = driver.variables.new()
        variable.targets[0].id_type = "KEY"
        variable.targets[0].id = base
        variable.targets[0].data_path = path


def apply(obj: bpy.types.Object) -> Generator[object, None, None]:
    """Give the object a refined mesh for good; others that share the mesh stay as they are.

    Raises:
        PnsError: the mesh cannot be refined.
    """
    mesh: bpy.types.Mesh = obj.data
    made: Made = yield from refine_mesh(obj, choice_of(mesh.pns_live), Share())
    remove(obj)
    obj.data = made.mesh
    take_name(made.mesh, mesh)


def shown_of(live: PNS_PG_live) -> bpy.types.Mesh:
    """Return the refined mesh that is shown."""
    return live.cache.data


def _spare_of(live: PNS_PG_live) -> bpy.types.Mesh:
    return live.second if shown_of(live) == live.first else live.first


def empty(result: bpy.types.Mesh) -> None:
    """Drop what a refined mesh holds, and what it says of it."""
    if result.shape_keys is not None:
        holder = bpy.data.objects.new(CARRIER, result)
        holder.shape_key_clear()
        bpy.data.objects.remove(holder)
    result.clear_geometry()
    result.pns_result.digest = ""


def paint(result: bpy.types.Mesh, materials: Sequence[bpy.types.Material | None]) -> None:
    """Put materials into a refined mesh's slots; those that are too few are none."""
    for slot in range(len(result.materials)):
        result.materials[slot] = materials[slot] if slot < len(materials) else None


def point(mesh: bpy.types.Mesh) -> None:
    """Let all that show the mesh live show its copy."""
    for obj in users_of(mesh):
        point_at(obj, mesh.pns_live.cache)
        rescale(obj)


def remove(obj: bpy.types.Object) -> None:
    """Show the base mesh again."""
    hide(obj)
    remove_modifier(obj)
    _forget(obj.data)


def take_away_cache(mesh: bpy.types.Mesh) -> None:
    """Remove a mesh's copy from the file, if no other mesh has it too."""
    live = mesh.pns_live
    holders, results = (live.cache, live.spare), (live.first, live.second)
    borrowed = _borrowed(mesh)
    for name in CACHE:
        live.property_unset(name)
    if borrowed:
        return
    for holder in holders:
        if holder is not None:
            bpy.data.objects.remove(holder)
    for result in results:
        if result is not None and result.users == 0:
            bpy.data.meshes.remove(result)


def _forget(mesh: bpy.types.Mesh) -> None:
    """Drop a mesh's live result when no object shows it any more."""
    if users_of(mesh):
        return
    take_away_cache(mesh)
    for name in LIVE:
        mesh.pns_live.property_unset(name)


def _make_cache(mesh: bpy.types.Mesh) -> None:
    """Give a mesh a copy of its own, with nothing in it yet."""
    live = mesh.pns_live
    live.first, live.second = (bpy.data.meshes.new(f".{mesh.name} refined") for _ in range(2))
    live.cache = bpy.data.objects.new(f".{mesh.name} live", live.first)
    # A mesh that is appended or linked without an object is given one, in the scene.
    live.spare = bpy.data.objects.new(f".{mesh.name} spare", live.second)


def _read_edits(obj: bpy.types.Object) -> None:
    """Bring what is edited into the mesh, and let that be told of now, as no edit of anybody's."""
    obj.update_from_editmode()
    windows = bpy.context.window_manager.windows
    for layer in [window.view_layer for window in windows] or [bpy.context.view_layer]:
        layer.update()


@contextmanager
def _as_it_is(obj: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """Copy an object and its mesh for a while, as what is edited can neither be read nor waits."""
    still = obj.copy()
    still.name, still.data = ".pns still", copied(obj.data)
    mesh = still.data
    try:
        yield still
    finally:
        bpy.data.objects.remove(still)
        bpy.data.meshes.remove(mesh)


def _keep_out_of_scenes(live: PNS_PG_live) -> None:
    """Take back what Blender does when it appends or pastes: the copy comes into view."""
    for hidden in (live.cache, live.spare):
        for collection in hidden.users_collection:
            collection.objects.unlink(hidden)


def _borrowed(mesh: bpy.types.Mesh) -> bool:
    """Return whether another mesh has the same result, as after duplication."""
    cache = mesh.pns_live.cache
    return cache is not None and any(
        other != mesh and other.pns_live.cache == cache for other in bpy.data.meshes
    )


def _digest(mesh: bpy.types.Mesh, reading: Reading, live: PNS_PG_live) -> str:
    """Return a text that changes when the mesh changes, or what is asked for."""
    digest = hashlib.blake2b(digest_size=16)
    snapshot = reading.snapshot
    for layer in snapshot.layers:
        digest.update(repr((layer.name, layer.kind, layer.domain, layer.texts)).encode())
        digest.update(np.ascontiguousarray(layer.values))
    for array in (
        snapshot.points,
        snapshot.triangles,
        snapshot.polygon_corners,
        snapshot.edges,
        snapshot.crease_sharpness,
        snapshot.vertex_sharpness,
        snapshot.groups,
        snapshot.offsets,
    ):
        digest.update(np.ascontiguousarray(array))
    materials = [None if material is None else material.name for material in mesh.materials]
    groups = [astuple(group) for group in reading.groups]
    asked = [getattr(live, name) for name in Settings.__annotations__]
    digest.update(repr((materials, groups, asked, reading.key_names)).encode())
    return digest.hexdigest()
