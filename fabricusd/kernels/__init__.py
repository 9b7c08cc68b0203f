"""The foundation of every compiled kernel: elementary functions, compiler settings, the cache."""

from fabricusd.kernels.cache import use_cache

# This has to run before the first kernel is defined, because numba chooses its cache folder then.
use_cache()
