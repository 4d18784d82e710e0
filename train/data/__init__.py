"""Data sets, grids, patches, parts and the stream: seeded coarse meshes on known surfaces."""
