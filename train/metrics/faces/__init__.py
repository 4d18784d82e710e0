"""The faces of a mesh in space: which is nearest to a point, which cross each other."""
