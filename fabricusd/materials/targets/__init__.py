"""What a bake is turned into: USD layers, MaterialX, OSL, U3M, packages."""
