"""The appearance of thread and weave: pure mathematics, no USD, no Embree, no files."""

from fabricusd.kernels.cache import forget_stale_kernels

forget_stale_kernels()
