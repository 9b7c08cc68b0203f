"""Readers of mesh files: OBJ, glTF and PLY."""
