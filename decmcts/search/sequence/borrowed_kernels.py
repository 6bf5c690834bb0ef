"""Arrays without reference counts, for loops that hand arrays to small functions.

Numba counts references atomically wherever a function takes an array out of a
tuple, which can cost more than the function's work. A borrowed array has no count;
its owner must outlive it, as a kernel's arguments outlive the call. Its type
says that it may be written, whether it may or not, so that what it is passed to
is compiled once.
"""

from __future__ import annotations

from typing import Any, TypeVar

from numba import types
from numba.extending import intrinsic, overload

A = TypeVar("A")

_NamedTuple: Any = types.BaseNamedTuple  # its own types leave out its fields
_of_fields: Any = types.BaseTuple.from_types


def _type_of(kind: Any) -> Any:
    """Return the type of what is borrowed."""
    if isinstance(kind, types.Array):
        return kind.copy(readonly=False)
    if isinstance(kind, _NamedTuple):
        return _of_fields(tuple(map(_type_of, kind)), kind.instance_class)
    return kind


def _without_count(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Copy the descriptor of an array, or of all arrays of a named tuple, with no owner in it."""
    if isinstance(kind, types.Array):
        view = context.make_array(_type_of(kind))(context, builder, value)
        view.meminfo, view.parent = view.meminfo.type(None), view.parent.type(None)
        return view._getvalue()
    if isinstance(kind, _NamedTuple):
        views = [
            _without_count(context, builder, field, builder.extract_value(value, k))
            for k, field in enumerate(kind)
        ]
        return context.make_tuple(builder, _type_of(kind), views)
    return value


@intrinsic
def _borrowed(typing_context: Any, given: Any) -> Any:
    """Make a view of what is given."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_count(context, builder, given, arguments[0])

    return _type_of(given)(given), generate


def borrowed(given: A) -> A:
    """Return a view of an array, or of a named tuple with arrays, without a count.

    It is valid while what is given lives.
    """
    return given


@overload(borrowed, strict=False)
def _compiled(given: Any) -> Any:
    """Take the view; plain Python has nothing to gain."""
    return lambda given: _borrowed(given)  # type: ignore[call-arg]
