"""The scattering kernels as GLSL ES 3.00, translated from their Python source.

The scalar kernels of numba are without recursion, allocation and exceptions, so a walk over their
syntax trees is enough. What is not understood raises NotImplementedError: a kernel that changes
changes the GLSL, or the translation fails. `python -m fabricusd.preview.glsl` writes the GLSL anew.
"""
