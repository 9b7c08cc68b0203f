"""Pictures of cloth at once: one key light and a sky, no bounces; see docs/preview.md."""
