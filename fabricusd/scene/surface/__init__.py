"""Turning meshes into triangles: polygons, subdivision surfaces and normals."""
