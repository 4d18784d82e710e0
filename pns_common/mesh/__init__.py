"""Meshes: faces of any degree, edges and their classes, creases, normals, selections."""
