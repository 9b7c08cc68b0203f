"""`preview --serve`: the page beside the readers of cloth and the path tracer, on this machine."""
