"""Compressed geometry, decoded as if it had come plain: Draco, and meshopt."""
