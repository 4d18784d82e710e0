# SPDX-License-Identifier: GPL-3.0-or-later
"""PNS Refine: proximity-preserving neural subdivision of meshes.

Only what is registered knows Blender's interface; ``refining`` knows no Blender at all.
"""


def register() -> None:
    """Do what is to be done when the extension is enabled."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Do what is to be done when the extension is disabled."""
    from . import registration

    registration.unregister()
