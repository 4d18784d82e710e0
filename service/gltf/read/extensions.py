"""`extensionsUsed` and `extensionsRequired`: what a file says it needs, kept true."""

from __future__ import annotations

from typing import Any

_LISTS = ("extensionsUsed", "extensionsRequired")


def withdraw(tree: dict[str, Any], name: str) -> bool:
    """Take an extension that nothing uses any more off both lists; whether it was on one."""
    listed = False
    for key in _LISTS:
        names = tree.get(key, [])
        if name in names:
            listed = True
            tree[key] = [other for other in names if other != name]
            # An empty list is not allowed.
            if not tree[key]:
                del tree[key]
    return listed


def drop(holder: dict[str, Any], name: str) -> None:
    """Take an extension out of what has it, if it does; no object without members stays behind."""
    extensions = holder.get("extensions", {})
    extensions.pop(name, None)
    if not extensions:
        holder.pop("extensions", None)


def declare(tree: dict[str, Any], name: str) -> None:
    """Put an extension that no reader can do without on both lists."""
    for key in _LISTS:
        names = tree.setdefault(key, [])
        if name not in names:
            names.append(name)
