"""Registers every rule with USD's validation framework.

USD imports this module by the name in `plugin/plugInfo.json` when one of its validators is asked
for, so that a pipeline's own checker runs the same rules as `fabricusd check`. It takes USD 26.5:

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    UsdValidation.ValidationContext(validators).Validate(stage)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pxr import Usd, UsdValidation

from fabricusd.host import VALIDATORS_FROM, in_words
from fabricusd.schema.rules.rules import RULES, Rule, applies, run

PLUGIN_NAME = "fabricusd.schema.validators"


def _task(checked: Rule) -> Callable[[Usd.Prim, Any], list[UsdValidation.ValidationError]]:
    kind = (
        UsdValidation.ValidationErrorType.Error
        if checked.severity == "error"
        else UsdValidation.ValidationErrorType.Warn
    )

    def validate(prim: Usd.Prim, _times: Any) -> list[UsdValidation.ValidationError]:
        if not applies(checked, prim):
            return []
        errors = []
        for name, problem in run(checked, prim):
            path = prim.GetPath().AppendProperty(name) if name else prim.GetPath()
            site = UsdValidation.ValidationErrorSite(prim.GetStage(), path)
            message = f"{prim.GetPath()} {name} {problem}"
            errors.append(UsdValidation.ValidationError(checked.name, kind, [site], message))
        return errors

    return validate


def _register() -> None:
    registry = UsdValidation.ValidationRegistry()
    if not hasattr(registry, "RegisterPluginPrimValidator"):
        raise ImportError(
            f"USD runs rules written in Python from {in_words(VALIDATORS_FROM)} on, and this is "
            f"{in_words(Usd.GetVersion()[1:])}; take fabricusd's folder `validators` out of "
            "PXR_PLUGINPATH_NAME, and run `fabricusd check` instead"
        )
    for checked in RULES:
        registry.RegisterPluginPrimValidator(f"{PLUGIN_NAME}:{checked.name}", _task(checked))


_register()
