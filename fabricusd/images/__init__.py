"""Image files; no other room knows OpenImageIO."""
