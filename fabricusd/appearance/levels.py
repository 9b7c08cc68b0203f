"""The levels of detail at which cloth is evaluated, and their numbers."""

from __future__ import annotations

LEVELS = ("far", "weave", "thread")
"""far : the mean over the repeat; weave : the thread under a point; thread : also the position
across the width of that thread."""

FAR, WEAVE, THREAD = range(len(LEVELS))
