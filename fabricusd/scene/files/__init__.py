"""Mesh files: OBJ, glTF and PLY."""
