"""Code that is only there to be linked into a kernel: neither optimised nor made machine code.

Numba optimises every function for itself and makes machine code and two wrappers of
it, also of those only other compiled functions call; then it links them into their
callers and optimises all again. Two fifths of the time of compiling our kernels went
into what nobody calls. Here functions met on the way to a kernel stay as they were
lowered; the kernel's own library is optimised with all it links, as ever.

Functions that make no array and return none only *borrow* those they are handed. Numba counts who
holds an array at every call and for every array of a struct, one locked addition each, though the
caller holds it all the while. That was two thirds of the time of our kernels, and more where two
threads count the same arrays. What only borrows needs no counting.
"""

from __future__ import annotations

import ast
import ctypes
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
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


_NUMBERS = {
    "None", "int", "float", "bool", "tuple", "np", "float64", "float32", "int64", "int32", "int8",
    "uint64", "uint32", "uint8", "bool_",
}  # fmt: skip
_OF_NUMBERS = _NUMBERS | {
    "sqrt", "hypot", "floor", "ceil", "abs", "exp", "exp2", "log", "log2", "sin", "cos", "arctan2",
    "isnan", "isfinite", "isinf",
}  # fmt: skip
_BUILT_IN = {"abs", "bool", "float", "int", "len", "max", "min", "range", "round", "zip"}


def borrows(function: Callable[..., Any], *, compiled: type) -> bool:
    """Tell whether a function makes and returns no array, nor calls one that returns an array.

    What it calls may be functions of numbers, built-in or numpy's, named tuples, and other
    `compiled` functions. In doubt the answer is no.
    """
    if not _returns_numbers(function):
        return False
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    body = ast.Module(tree.body[0].body, [])  # type: ignore[attr-defined]  # a function it is
    inner = (ast.FunctionDef, ast.Lambda, ast.ListComp, ast.GeneratorExp, ast.List)
    return not any(isinstance(node, inner) for node in ast.walk(body)) and all(
        _is_harmless(node.func, function, compiled)
        for node in ast.walk(body)
        if isinstance(node, ast.Call)
    )


def _returns_numbers(function: Callable[..., Any]) -> bool:
    """Tell whether a function says that it returns numbers, or named tuples of them."""
    stated = function.__annotations__.get("return")
    if not isinstance(stated, str) or re.search(r"\btuple\b(?!\[)", stated):  # a tuple of anything
        return False
    return all(
        word in _NUMBERS or _has_numbers(function.__globals__.get(word))
        for word in re.findall(r"\w+", stated)
    )


def _has_numbers(known: Any) -> bool:
    """Tell whether something is a class of named tuples of numbers."""
    fields = getattr(known, "__annotations__", {})
    return (
        isinstance(known, type)
        and issubclass(known, tuple)
        and bool(fields)
        and all(
            getattr(stated, "__forward_arg__", None) in _NUMBERS - {"tuple"}
            for stated in fields.values()
        )
    )


def _is_harmless(called: ast.expr, function: Callable[..., Any], compiled: type) -> bool:
    """Tell whether what is called makes no array."""
    if isinstance(called, ast.Attribute):
        owner = called.value
        return (
            isinstance(owner, ast.Name)
            and owner.id in ("np", "math")
            and (called.attr in _OF_NUMBERS)
        )
    if not isinstance(called, ast.Name):
        return False
    known = function.__globals__.get(called.id)
    if isinstance(known, compiled):
        return _returns_numbers(known.py_func)  # type: ignore[attr-defined]  # of all compiled
    if isinstance(known, type):
        return issubclass(known, tuple)
    return known is None and called.id in _BUILT_IN
