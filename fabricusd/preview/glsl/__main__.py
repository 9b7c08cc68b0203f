"""Write the page's kernels anew: `python -m fabricusd.preview.glsl`."""

from __future__ import annotations

from fabricusd.preview.glsl.kernels import SHADER, shader

if __name__ == "__main__":
    SHADER.parent.mkdir(exist_ok=True)
    SHADER.write_text(shader(), "utf-8")
