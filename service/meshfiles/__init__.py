"""Plain mesh files: OBJ, PLY, STL, OFF, 3MF, and conversion from and to glTF."""
