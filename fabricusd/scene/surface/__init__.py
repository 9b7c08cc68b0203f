"""Meshes as triangles: polygons, subdivision surfaces, normals."""
