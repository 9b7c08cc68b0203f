"""The compiled loops of the preview; kernels are cached by the sources of this folder."""
