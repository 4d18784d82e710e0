"""Plain mesh files: OBJ, PLY, STL, OFF, and conversion from and to glTF."""
