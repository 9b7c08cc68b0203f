"""Which thread lies at a point of the cloth, and how it runs there."""
