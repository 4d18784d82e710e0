"""Model files: what a model says of itself, how its file is checked, and who runs it."""
