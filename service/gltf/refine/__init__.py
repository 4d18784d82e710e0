"""Refine a glTF mesh and all that follows its vertices."""
