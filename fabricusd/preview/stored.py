"""Fabrics as JSON: what the preview keeps of a source, so that USD need not be loaded again."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from fabricusd.fabric import Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.sides import Sides

_CLASSES: dict[str, Any] = {
    c.__name__: c for c in (Fabric, Thread, ThreadSet, TangentCurve, Weave, Sides)
}


def to_json(fabric: Fabric) -> str:
    """The whole fabric, its back included; numbers keep all their digits."""
    return json.dumps(_plain(fabric))


def from_json(text: str) -> Fabric:
    """The inverse of `to_json`. Raises ValueError or KeyError for other text."""
    found = _built(json.loads(text))
    if not isinstance(found, Fabric):
        raise ValueError("is not a fabric")
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        bits = base64.b64encode(np.packbits(value).tobytes()).decode()
        return {"is": "cells", "shape": list(value.shape), "bits": bits}
    if is_dataclass(value) and not isinstance(value, type):
        said = {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
        return {"is": type(value).__name__, **said}
    if isinstance(value, Mapping):
        return {"is": "mapping", "items": [[k, _plain(v)] for k, v in value.items()]}
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value


def _built(said: Any) -> Any:
    if isinstance(said, list):
        return tuple(_built(one) for one in said)
    if not isinstance(said, dict):
        return said
    kind = said["is"]
    if kind == "cells":
        bits = np.frombuffer(base64.b64decode(said["bits"]), np.uint8)
        m, n = said["shape"]
        return np.unpackbits(bits)[: m * n].reshape(m, n).astype(bool)
    if kind == "mapping":
        return {k: _built(v) for k, v in said["items"]}
    return _CLASSES[kind](**{k: _built(v) for k, v in said.items() if k != "is"})
