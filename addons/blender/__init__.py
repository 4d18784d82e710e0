"""The Blender extension, how it is built, and pictures rendered with Blender."""
