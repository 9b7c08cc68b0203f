"""The levels of detail at which cloth is evaluated, numbered once for everyone."""

from __future__ import annotations

LEVELS = ("far", "weave", "thread")
"""The whole repeat at once; the thread under a point; the place across that thread as well."""

FAR, WEAVE, THREAD = range(len(LEVELS))
