"""Measured numbers: one step, whole surfaces, distances between meshes, the envelope's limit."""
