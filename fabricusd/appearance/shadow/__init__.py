"""Heights of the threads, and the shadows they throw on one another."""
