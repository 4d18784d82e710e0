"""A mesh with all that hangs on it, refined as arrays. Nothing here knows Blender."""
