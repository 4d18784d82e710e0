"""Leave out tests that need Blender where it is not there; `make blender-test` runs them."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("bpy") else ["in_blender"]
