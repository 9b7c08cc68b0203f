"""Modules that can be called: `fabricusd.bake` is a folder of the package and a function."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any


class CallableModule(ModuleType):
    """A module that passes a call on to the function of its own name in `fabricusd.api`."""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """What the function returns."""
        return _function(self.__name__)(*arguments, **named)

    @property
    def __signature__(self) -> Any:
        from inspect import signature

        return signature(_function(self.__name__))

    def __reduce__(self) -> tuple[Callable[[str], ModuleType], tuple[str]]:
        return import_module, (self.__name__,)


def make_callable(name: str) -> None:
    """Let the module `name`, which is being imported, be called."""
    sys.modules[name].__class__ = CallableModule


def _function(module: str) -> Callable[..., Any]:
    found: Callable[..., Any] = getattr(import_module("fabricusd.api"), module.rpartition(".")[2])
    return found
