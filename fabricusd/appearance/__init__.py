"""The appearance of thread and weave: pure mathematics, no USD, no Embree, no files."""
