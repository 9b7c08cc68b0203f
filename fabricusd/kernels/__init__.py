"""What every compiled kernel rests on: elementary functions, parts of kernels, the cache."""

from fabricusd.kernels.cache import use_cache

# Before the first kernel is defined: that is when numba chooses the folder it caches in.
use_cache()
