"""The foundation of every compiled kernel: elementary functions, compiler settings, the cache."""

from fabricusd.kernels.cache import use_cache
from fabricusd.kernels.processor import choose_level

# These have to run before the first kernel is defined, because numba chooses its cache folder and
# the processor's features then.
choose_level()
use_cache()
