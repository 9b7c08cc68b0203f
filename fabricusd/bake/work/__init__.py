"""How a bake is carried out, kept and gone on with."""
