"""What every compiled kernel rests on: elementary functions, parts of kernels, the cache."""
