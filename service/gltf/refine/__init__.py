"""What becomes of a glTF mesh and of all that follows its vertices."""
