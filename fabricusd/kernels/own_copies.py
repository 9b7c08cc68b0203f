"""Let each compiled kernel call its own copies of the functions that it shares with others.

A kernel's machine code holds a copy of every function that it calls, each compiled with that
kernel around it. numba gives all copies of a function one name, and whichever was loaded first
serves all kernels. Copies differ in how they are vectorised, and so in their last bits: a process
that compiles a kernel, and one that loads it from the cache, would get different results. Here the
copies are private to their kernel.
"""

from __future__ import annotations

from typing import Any


def use_own_copies() -> None:
    """Change numba's compiler. Raises ImportError or AttributeError where it has other parts."""
    from llvmlite.binding import Linkage
    from numba.core.codegen import CPUCodeLibrary

    made = CPUCodeLibrary._finalize_final_module

    def finalize(library: Any) -> None:
        if getattr(library, "_compiled_object", None) is None:
            _make_private(library, Linkage)
        made(library)

    CPUCodeLibrary._get_module_for_linking  # noqa: B018, raises where it is missing
    CPUCodeLibrary._finalize_final_module = finalize


def _make_private(library: Any, linkage: Any) -> None:
    """Keep a module for other kernels to link, and hide what this kernel has linked from others."""
    whole = library._final_module
    shared = [
        f.name for f in whole.functions
        if not f.is_declaration and f.linkage in (linkage.linkonce_odr, linkage.weak_odr)
    ]  # fmt: skip
    if not shared:
        return
    # As numba does it later, of the module as it is now.
    ours = whole.clone()
    for f in list(ours.functions):
        if not f.is_declaration and f.linkage == linkage.external:
            f.linkage = "linkonce_odr"
    library._shared_module = ours
    for name in shared:
        whole.get_function(name).linkage = "internal"
