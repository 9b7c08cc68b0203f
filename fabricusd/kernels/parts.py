"""Compile functions that only kernels call as parts of those kernels.

numba optimises each function by itself, generates machine code for it and wraps it for Python; its
caller then gets a copy and optimises that copy again. If Python never calls the function, only the
copy ever runs. With `PartCompiler` as its `pipeline_class`, a function that is compiled because
another function calls it is typed and lowered as usual, but is linked into its caller unoptimised.
This saves a quarter of the time that the kernels of a first picture take to compile.
"""

from __future__ import annotations

import ctypes
from typing import Any

from numba import _dynfunc, njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering

import fabricusd.kernels.start  # noqa: F401


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A library that is only linked into its callers: it is not optimised and emits no machine
    code."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            if hasattr(self, "_reload_init"):
                self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):  # type: ignore[misc]
    """numba's lowering, into a `_PartLibrary` if another function is waiting for this one."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        # The stack holds the options of every function being compiled, with this one's on top.
        if len(ConfigStack()) < 2:
            return bool(super().run_pass(state))
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        for option in ("no_cpython_wrapper", "no_cfunc_wrapper", "no_compile"):
            setattr(state.flags, option, True)
        super().run_pass(state)
        lowered = state["cr"]
        entry = _entry_for_python(state.func_id.func, lowered)
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        # Libraries carry this from numba 0.63 on.
        state.reload_init.extend(getattr(state.library, "_reload_init", ()))
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class PartCompiler(Compiler):  # type: ignore[misc]
    """numba's compiler, for functions that are usually parts of a kernel."""

    def define_pipelines(self) -> list[PassManager]:
        """numba's passes, with `_PartLowering` in place of its own lowering."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [
            (_PartLowering if step is NativeLowering else step, words)
            for step, words in manager.passes
        ]
        manager.finalize()
        return [manager]


def _entry_for_python(function: Any, lowered: Any) -> Any:
    """The entry point of a part that Python calls after all, as tests do.

    The first call compiles the function by itself. numba requires a builtin function here, and a
    separate one for every part.
    """
    alone: list[Any] = []

    @ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object, ctypes.py_object, ctypes.c_void_p)
    def call(_closure: Any, arguments: Any, _keywords: Any) -> Any:
        if not alone:
            alone.append(njit(error_model="numpy")(function))
        return alone[0](*arguments)

    address = ctypes.cast(call, ctypes.c_void_p).value
    module = lowered.fndesc.lookup_module()
    return _dynfunc.make_function(
        module, function.__name__, function.__doc__ or "", address, lowered.env, (call,)
    )
