"""PLY: what its header says, and polygons of many sizes as triangles."""
