"""The thread models: one module each, named as in `fabric.MODELS`, which numbers them.

To add one: a module here with a `MODEL`, its name at the end of `fabric.MODELS`, `make schema`.
"""

from __future__ import annotations

from importlib import import_module

from fabricusd.appearance.scattering.model import CONSERVING, PUBLISHED, ThreadModel
from fabricusd.fabric import MODELS, Fabric, Thread

REGISTRY: tuple[ThreadModel, ...] = tuple(
    import_module(f"{__name__}.{name}").MODEL for name in MODELS
)
"""The models in the order of `fabric.MODELS`: an index here is what the column MODEL holds."""

PUBLISHED_MODELS = tuple(k for k, model in enumerate(REGISTRY) if model.law == PUBLISHED)
CONSERVING_MODELS = tuple(k for k, model in enumerate(REGISTRY) if model.law == CONSERVING)


def named(name: str) -> ThreadModel:
    """The model called `name`, one of `fabric.MODELS`."""
    return REGISTRY[MODELS.index(name)]


def names(law: int) -> tuple[str, ...]:
    """Names of the models whose threads follow a surface law."""
    return tuple(n for n, model in zip(MODELS, REGISTRY, strict=True) if model.law == law)


def model_of(fabric: Fabric, thread: Thread) -> ThreadModel:
    """The model by which a thread of a fabric is evaluated."""
    return named(fabric.model_of(thread))


def any_conserving(fabric: Fabric) -> bool:
    """Whether some thread follows the conserving law."""
    return any(model_of(fabric, t).law == CONSERVING for t in fabric.thread_list)


def any_published(fabric: Fabric) -> bool:
    """Whether some thread follows the published law."""
    return any(model_of(fabric, t).law == PUBLISHED for t in fabric.thread_list)
