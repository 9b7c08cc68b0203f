"""Look up the thread at a point of the cloth, and the course of its tangent curve."""
