"""Running work: workers, and stopping them."""
