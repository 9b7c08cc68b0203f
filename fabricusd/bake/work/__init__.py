"""Run a bake on several workers, checkpoint it, and resume it after an interruption."""
