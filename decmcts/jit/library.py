"""Code that is only there to be linked into a kernel: neither optimised nor made machine code.

Numba optimises every function for itself and makes machine code and two wrappers of
it, also of those only other compiled functions call; then it links them into their
callers and optimises all again. Two fifths of the time of compiling our kernels went
into what nobody calls. Here functions met on the way to a kernel stay as they were
lowered; the kernel's own library is optimised with all it links, as ever.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import codegen, registry
from numba.core.environment import lookup_environment

ENVIRONMENT = "_ZN08NumbaEnv"  # begins the names of variables that hold a function's globals

_attributes: dict[str, str] = {}  # part of a function's symbol -> alwaysinline or noinline
_being_compiled: list[str] = []  # name of the kernel; under numba's compiler lock

_JitLibrary: Any = codegen.JITCodeLibrary  # numba has no types of its own
_Codegen: Any = codegen.JITCPUCodegen
_environment_of: Any = lookup_environment


class LinkedLibrary(_JitLibrary):  # type: ignore[misc]  # untyped base
    """A code library that stops short where it is met on the way to a kernel."""

    only_linked = False

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._on_the_way = bool(_being_compiled) and name != _being_compiled[0]

    def _optimize_final_module(self) -> None:
        """Optimise, unless the kernel will be, with all it links."""
        self.only_linked = self._on_the_way
        if not self.only_linked:
            self._mark_functions()
            super()._optimize_final_module()

    def _mark_functions(self) -> None:
        """Say of each function how it is called, where that is not left to the compiler."""
        for function in self._final_module.functions:
            if function.is_declaration:
                continue
            for name, attribute in _attributes.items():
                if name in function.name:
                    function.add_function_attribute(attribute)

    def _finalize_final_module(self) -> None:
        """Make machine code, unless nobody will run it."""
        if not self.only_linked:
            super()._finalize_final_module()
            return
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class LinkedCodegen(_Codegen):  # type: ignore[misc]  # untyped base
    """A code generator whose functions may have no machine code."""

    def set_env(self, name: str, environment: Any) -> None:
        """Hand a function its globals, if there is machine code that holds them."""
        if self._engine.get_global_value_address(name):
            super().set_env(name, environment)


def set_attribute(name: str, attribute: str) -> None:
    """Give all functions of this name an LLVM attribute where they are linked into a kernel.

    Numba's own option `forceinline` passes on to every function that is first met within such
    a one, large ones and numba's among them: what was inlined, and how long compiling took,
    hung on what the process had compiled before.
    """
    _attributes[f"{len(name)}{name}B"] = attribute  # as numba mangles it


def compiling() -> bool:
    """Say whether a kernel is being compiled, so that what is asked for is on its way."""
    return bool(_being_compiled)


@contextmanager
def compiling_kernel(name: str) -> Iterator[None]:
    """Make no more of other functions than this kernel needs to link; hold the compiler lock."""
    generator = registry.cpu_target.target_context.codegen()
    before = generator._library_class, type(generator)
    generator._library_class, generator.__class__ = LinkedLibrary, LinkedCodegen
    _being_compiled.append(name)
    try:
        yield
    finally:
        _being_compiled.pop()
        generator._library_class, generator.__class__ = before


def hand_environments(library: Any) -> None:
    """Hand their globals to the functions linked into a kernel's machine code."""
    engine = library.codegen._engine
    for variable in library._final_module.global_variables:
        if not variable.name.startswith(ENVIRONMENT):
            continue
        environment = _environment_of(variable.name)
        address = engine.get_global_value_address(variable.name)
        if environment is not None and address:
            pointer = (ctypes.c_void_p * 1).from_address(address)
            pointer[0] = ctypes.c_void_p(id(environment))
