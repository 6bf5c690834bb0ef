"""Travels of a plan by the layer they lead to, and which of them another plan has too.

Figures for pictures; nothing is judged, and nothing is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.errors import InputError
from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument

SAME_PLACE_MM = 0.02  # a grid: ends of travels in one cell of it are one place


@dataclass(frozen=True, slots=True)
class Travels:
    """The travels of all heads: each is what lies between two contours a head prints.

    Waits in between are part of it; the way to the park at the end is none. Where a head does
    nothing between two contours there is no travel, though they may lie apart: so the source's
    order is told in the pieces of a cut print, whose joints no head ever moved along.
    """

    head: Ints  # (k,) index of the head
    first: Ints  # (k,) its first point in the head's path
    last: Ints  # (k,) and its last
    layer: Ints  # (k,) row of `layers`: of the contour it leads to
    inside: Flags  # (k,) it comes from that layer too
    length_mm: Floats  # (k,) as moved, lifts included
    ends: Ints  # (k, 2) both ends, as `both_ends`


def in_no_place_of(ends: Ints, others: Ints) -> Flags:
    """Tell which of these ends (k, 2) are none of the others (m, 2), (k,)."""
    _, number = np.unique(np.concatenate([ends, others]), axis=0, return_inverse=True)
    number = number.reshape(-1)
    return ~np.isin(number[: len(ends)], number[len(ends) :])


def both_ends(actions: HeadActions, first: Ints, last: Ints) -> Ints:
    """Return two points of a path each as cells of a grid, numbered, the lesser first, (k, 2).

    So a way is the same whichever way it is gone.
    """
    x, y, z = np.rint(actions.path[np.stack([first, last])] / SAME_PLACE_MM).astype(np.int64).T
    return np.sort((x << 42) + (y << 21) + z, axis=1)


def layers_of(document: PlanDocument) -> tuple[Int32s, Floats]:
    """Return the numbers of the layers as sliced and the height of each, (n,) and (n,) mm."""
    layers, row = np.unique(document.contours.layer, return_inverse=True)
    top = np.full(len(layers), -np.inf)
    np.maximum.at(top, row.reshape(-1), document.contours.top)
    return layers, top


def require_layer(layer: int | None, contours: Contours) -> None:
    """Raise InputError for a layer, from 1, that is none of the print's."""
    n_layers = len(np.unique(contours.layer))
    if layer is not None and not 1 <= layer <= n_layers:
        raise InputError(
            f"there is no layer {layer} to draw: the print has layers 1 to {n_layers}",
            advice="name one of them, or leave --picture-layer out",
        )


def travels_of(document: PlanDocument) -> Travels:
    """Return all travels of a plan; linear in its points."""
    layers, _ = layers_of(document)
    layer_of = np.searchsorted(layers, document.contours.layer)
    heads = [_of_head(k, head, layer_of) for k, head in enumerate(document.plan.heads)]
    return Travels(*(np.concatenate(column) for column in zip(*heads, strict=True)))


def _of_head(index: int, actions: HeadActions, layer_of: Ints) -> tuple[NDArray[np.generic], ...]:
    """Return the columns of `Travels` for one head."""
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    first = np.append(0, actions.path_offsets[prints[:-1] + 1]) if len(prints) else prints
    last = actions.path_offsets[prints]
    steps = np.linalg.norm(np.diff(actions.path, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(steps))
    layer = layer_of[actions.contour[prints]]
    before = np.append(-1, layer[:-1]) if len(prints) else layer
    made = along[last] - along[first]
    kept = (made > 0.0) & (np.diff(prints, prepend=-1) > 1)
    columns = (
        np.full(len(prints), index), first, last, layer, layer == before, made,
        both_ends(actions, first, last),
    )  # fmt: skip
    return tuple(column[kept] for column in columns)


def by_layer(travels: Travels, n_layers: int) -> Floats:
    """Return the length that leads to each layer, (n_layers,) mm."""
    return np.bincount(travels.layer, travels.length_mm, n_layers).astype(np.float64)


def most_changed(before_mm: Floats, after_mm: Floats) -> int:
    """Return the layer where travel changed most: in the direction it changed as a whole."""
    saved = before_mm - after_mm
    return int(np.argmax(saved if saved.sum() >= 0.0 else -saved))
