"""The height field of the threads, and the shadows that they cast on one another."""
