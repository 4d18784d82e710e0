"""Meshes of other libraries, refined with their data; none of these libraries is imported."""
