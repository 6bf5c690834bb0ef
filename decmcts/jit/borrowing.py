"""Which functions make no array and return none: they only borrow those they are handed.

Numba counts who holds an array at every call and for every array of a struct, one locked
addition each, though the caller holds it all the while. That was two thirds of the time of our
kernels, and more where two threads count the same arrays. What only borrows needs no counting.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Any

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
