"""The foundation of every compiled kernel: elementary functions, compiler settings, the cache."""

from contextlib import suppress

from fabricusd.kernels.cache import use_cache
from fabricusd.kernels.internals import use_internals
from fabricusd.kernels.own_copies import use_own_copies
from fabricusd.kernels.processor import choose_level

# These have to run before the first kernel is defined, because numba chooses its cache folder and
# the processor's features then.
choose_level()
use_cache()
if use_internals():
    with suppress(ImportError, AttributeError):
        use_own_copies()
