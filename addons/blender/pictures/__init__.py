"""Pictures of what the operator does. All but `variants` needs Blender."""
