"""Running work in batches: workers, and how they are stopped."""
