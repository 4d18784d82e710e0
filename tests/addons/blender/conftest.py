"""What needs Blender is left out where it is not there; `make blender-test` runs it where it is."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("bpy") else ["in_blender"]
