"""Recipes, networks, their checkpoints, and the author's published networks."""
