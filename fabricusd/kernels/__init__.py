"""The foundation of every compiled kernel: elementary functions, compiler settings, the cache."""

from fabricusd.kernels.cache import use_cache
from fabricusd.kernels.vectors import use_wide_vectors

# These have to run before the first kernel is defined, because numba chooses its cache folder and
# the processor's features then.
use_cache()
use_wide_vectors()
