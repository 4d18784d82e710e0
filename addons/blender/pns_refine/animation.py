"""Actions, drivers and NLA tracks of one datablock on another."""

from __future__ import annotations

import bpy

_STRIP = (
    "frame_start",
    "frame_end",
    "action_frame_start",
    "action_frame_end",
    "scale",
    "repeat",
    "blend_type",
    "extrapolation",
    "blend_in",
    "blend_out",
    "use_auto_blend",
    "use_reverse",
    "use_animated_influence",
    "influence",
    "mute",
)


def copy_animation(source: bpy.types.ID, target: bpy.types.ID) -> None:
    """Give ``target`` the action, drivers and tracks of ``source``; actions are shared."""
    old = source.animation_data
    if old is None:
        return
    new = target.animation_data_create()
    for name in ("action_blend_type", "action_extrapolation", "action_influence", "use_nla"):
        setattr(new, name, getattr(old, name))
    _assign_action(old, new)
    for driver in old.drivers:
        copied = new.drivers.from_existing(src_driver=driver)
        for variable in copied.driver.variables:
            for end in variable.targets:
                if end.id == source:
                    end.id = target
    for track in old.nla_tracks:
        _copy_track(track, new)


def redirect_drivers(key: bpy.types.Key | None, old: bpy.types.ID, new: bpy.types.ID) -> None:
    """Let drivers that listen to ``old`` listen to ``new``, as when an object is duplicated."""
    if key is None or key.animation_data is None:
        return
    for curve in key.animation_data.drivers:
        for variable in curve.driver.variables:
            for end in variable.targets:
                if end.id == old:
                    end.id = new


def _assign_action(old: bpy.types.AnimData, new: bpy.types.AnimData) -> None:
    if old.action is None:
        return
    new.action = old.action
    # Since 4.4 an action has slots, and each datablock uses one.
    if getattr(old, "action_slot", None) is not None:
        new.action_slot = old.action_slot


def _copy_track(track: bpy.types.NlaTrack, new: bpy.types.AnimData) -> None:
    copied = new.nla_tracks.new()
    copied.name = track.name
    for strip in track.strips:
        if strip.action is None:
            continue
        made = copied.strips.new(strip.name, int(strip.frame_start), strip.action)
        if getattr(strip, "action_slot", None) is not None:
            made.action_slot = strip.action_slot
        made.name = strip.name
        for name in _STRIP:
            setattr(made, name, getattr(strip, name))
    copied.mute, copied.lock = track.mute, track.lock
    copied.is_solo = track.is_solo
