"""The registry of thread models: one module per model, named and numbered by `fabric.MODELS`.

To add a model, write a module here that defines `MODEL`, append its name to `fabric.MODELS`, and
run `make schema`.
"""

from __future__ import annotations

from importlib import import_module

from fabricusd.appearance.scattering.model import CONSERVING, PUBLISHED, ThreadModel
from fabricusd.fabric import MODELS, Fabric, Thread

REGISTRY: tuple[ThreadModel, ...] = tuple(
    import_module(f"{__name__}.{name}").MODEL for name in MODELS
)
"""The models in the order of `fabric.MODELS`; the column MODEL holds an index into this tuple."""

PUBLISHED_MODELS = tuple(k for k, model in enumerate(REGISTRY) if model.law == PUBLISHED)
CONSERVING_MODELS = tuple(k for k, model in enumerate(REGISTRY) if model.law == CONSERVING)


def named(name: str) -> ThreadModel:
    """The model called `name`, one of `fabric.MODELS`."""
    return REGISTRY[MODELS.index(name)]


def names(law: int) -> tuple[str, ...]:
    """Names of the models whose threads follow `law`, PUBLISHED or CONSERVING."""
    return tuple(n for n, model in zip(MODELS, REGISTRY, strict=True) if model.law == law)


def model_of(fabric: Fabric, thread: Thread) -> ThreadModel:
    """The model with which a thread of a fabric is evaluated."""
    return named(fabric.model_of(thread))


def any_conserving(fabric: Fabric) -> bool:
    """Whether any thread follows the conserving law."""
    return any(model_of(fabric, t).law == CONSERVING for t in fabric.thread_list)


def translucent(fabric: Fabric) -> bool:
    """Whether threads scatter light to the other side of the cloth."""
    return not fabric.opaque and any_conserving(fabric)


def any_published(fabric: Fabric) -> bool:
    """Whether any thread follows the published law."""
    return any(model_of(fabric, t).law == PUBLISHED for t in fabric.thread_list)
