"""Mixtures of lobes near by: textures that say which threads a texel shows.

`parts` says what a texel holds, `mixture` turns a mixture and a texel into the lobes of that texel,
`fit` finds which lobes which threads make, and `maps` writes the textures from a bake.
"""

AUTO, TEXELS, REPEAT, OFF = NEAR = ("auto", "texels", "repeat", "off")
"""Where lobes take threads from: the texels of the bake, one repeat of even threads, or nowhere;
`auto` takes the texels of a bake that resolves threads, and the repeat for others."""
