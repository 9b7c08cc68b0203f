"""Arrays as the page holds them."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np


def decoded(said: dict[str, str]) -> np.ndarray:
    """The flat array of `arrays.array`."""
    kind: Any = np.dtype(said["type"]).newbyteorder("<")
    return np.frombuffer(base64.b64decode(said["data"]), kind)
