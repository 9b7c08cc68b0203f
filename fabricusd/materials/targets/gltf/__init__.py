"""The garment as binary glTF 2.0: geometry, textures, materials and the document itself."""
