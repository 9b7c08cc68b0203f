"""The appearance models of threads and cloth: pure mathematics, without USD, Embree or files."""
