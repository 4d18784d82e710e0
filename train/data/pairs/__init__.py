"""Coarse meshes of many kinds beside the surfaces that they stand for, and the stream of all."""
