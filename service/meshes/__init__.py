"""Meshes without a file format: welds, creases by angle, connectivity of splits, UV charts."""
