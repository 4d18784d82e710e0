"""Attributes of vertices and corners, refined with the mesh that carries them."""
