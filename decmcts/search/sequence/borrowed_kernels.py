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

from decmcts.search.sequence.metric_kernels import Timed, TimedBare

A = TypeVar("A")


@intrinsic
def _without_count(typing_context: Any, array: Any) -> Any:
    """Copy the array's descriptor with no owner in it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.return_type)(context, builder, arguments[0])
        view.meminfo, view.parent = view.meminfo.type(None), view.parent.type(None)
        return view._getvalue()

    return array.copy(readonly=False)(array), generate


def borrowed(array: A) -> A:
    """Return a view of an array, or a metric of such views, without a count."""
    return array


@overload(borrowed, strict=False)
def _borrowed(array: Any) -> Any:
    """Choose by type; plain Python has nothing to gain."""
    if isinstance(array, types.Array):
        return lambda array: _without_count(array)  # type: ignore[call-arg]
    if getattr(array, "instance_class", None) is Timed:
        return lambda array: Timed(
            borrowed(array.points), array.speed, array.acceleration, array.z_speed,
            array.z_acceleration, array.hop_s, array.free_mm,
        )  # fmt: skip
    if getattr(array, "instance_class", None) is TimedBare:
        return lambda array: TimedBare(
            borrowed(array.points), array.speed, array.acceleration, array.z_speed,
            array.z_acceleration, array.hop_s, array.free_mm, array.bare_mm, array.climb_mm,
            array.over, borrowed(array.walls),
        )  # fmt: skip
    return None
