"""Scenes from USD and mesh files: triangles, materials, lights, cameras."""
