"""What two heads that no rail joins can print at once at most: a matching and its proof.

Of two contours printed side by side one was begun later. A head that prints never waits, so
the later contour was begun only when the other head held nothing any more of its *whole* space.
So two pieces of contours exclude each other if the space still held of either is too near to
that of the other's whole contour, whichever head has which. A bound is the time of all
printing, less the largest fractional matching of pieces that do not exclude each other.

The matching is half the flow through the double cover of their graph. The least cover is the
proof: every piece has a price of 0, 1/2 or 1, and two that may be printed at once cost at
least 1 together. So the time printed at once is no more than the prices of all pieces.

Spaces are boxes, as `decmcts.team.engine.space` has them for plans made here, and are rounded
inwards until there are few enough different ones.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.machine import Machine
from decmcts.team.bounds.rail_bound import RailUse, whole_of
from decmcts.team.engine.space import relation_of
from decmcts.team.engine.spaces_kernels import TOUCH

CELL_MM = 1.0  # that they are rounded to; cells double until there are few enough
MOST_SPACES = 2_000
MOST_FLOW = 2.0**29  # of all; the solver's whole numbers have 32 bits


def pair_bound(
    along_x: RailUse,
    along_y: RailUse,
    machine: Machine,
    *,
    height_mm: float,
    most_spaces: int = MOST_SPACES,
) -> float:
    """Return seconds that no joint plan of the first two heads can beat; travel is not counted.

    Parameters
    ----------
    along_x, along_y : RailUse
        What is held of the bed, the same pieces in both.
    height_mm : float
        Of the print; what comes too near only at some heights counts as clear.
    most_spaces : int
        Different spaces that are distinguished; with fewer the bound is lower at most.
    """
    seconds, choice = along_x.seconds, along_x.choice
    if not len(seconds) or not float(seconds.sum()) > 0.0:
        return 0.0
    spaces, space = _spaces(along_x, along_y, most_spaces)
    clear = np.zeros((len(spaces), len(spaces)), np.bool_)
    for r in range(2):
        relation = relation_of(machine, r, 1 - r)
        always = (relation[:, 4] <= -height_mm) & (relation[:, 5] >= height_mm)
        clear |= _clear(spaces[:, :4], spaces[:, 4:], relation[always])
    clear |= clear.T
    contour, is_reversed = choice // 2, choice % 2 == 1
    both = np.isin(contour, contour[is_reversed])  # half of it in each direction, to find prices
    work = _sums(space, seconds * np.where(both, 0.5, 1.0))
    worth = seconds * (1.0 - cover_prices(clear, work)[space])
    choices, kind = np.unique(choice, return_inverse=True)
    of_choice = _sums(kind.reshape(-1), worth)
    begins = np.flatnonzero(np.diff(choices // 2, prepend=-1))
    return float(np.minimum.reduceat(of_choice, begins).sum())


def _sums(group: Ints, values: Floats) -> Floats:
    return np.bincount(group, weights=values).astype(np.float64)


def _spaces(along_x: RailUse, along_y: RailUse, most: int) -> tuple[Floats, Ints]:
    """Return the different spaces, and each piece's: low and high x, low and high y.

    First four sides of what is still held, then four of the whole contour.
    """
    both = (along_x, along_y)
    sides = [side for held in both for side in (held.low, held.high)]
    sides += [side for held in both for side in whole_of(held.choice, held.low, held.high)]
    spaces = np.column_stack(sides)
    space, cell = np.arange(len(spaces)), CELL_MM
    while True:  # what was rounded to a cell rounds to two of them as it would have at once
        spaces[:, 0::2] = np.ceil(spaces[:, 0::2] / cell) * cell
        spaces[:, 1::2] = np.floor(spaces[:, 1::2] / cell) * cell
        spaces, kind = np.unique(spaces, axis=0, return_inverse=True)
        space = kind.reshape(-1)[space]
        if len(spaces) <= most:
            return spaces, space
        cell *= 2.0


def _clear(a: Floats, b: Floats, relation: Floats) -> Flags:
    """Return where a head in a space of `a` and the other in one of `b` cannot meet, (k, k)."""
    least = b[None, :, 0::2] - a[:, None, 1::2]
    most = b[None, :, 1::2] - a[:, None, 0::2]
    near = np.zeros((len(a), len(b)), np.bool_)
    for box in relation:
        within = (least < box[1:4:2] - TOUCH) & (most > box[0:4:2] + TOUCH)
        near |= within.all(axis=2)
    return ~near


def cover_prices(clear: Flags, work: Floats) -> Floats:
    """Return prices of which any two that are clear have at least 1 together, (k,).

    Of the least cover in the double cover of the graph: left nodes that no more flow can
    reach, and right nodes it can.
    """
    k, nodes = len(work), np.arange(len(work))
    amount = np.ceil(work * (MOST_FLOW / float(work.sum()))).astype(np.int32)
    row, column = np.nonzero(clear)
    begin = np.concatenate([np.full(k, 2 * k), row, nodes + k])
    end = np.concatenate([nodes, column + k, np.full(k, 2 * k + 1)])
    no_limit = np.full(len(row), amount.sum(), np.int32)
    most = np.concatenate([amount, no_limit, amount])
    network = csr_matrix((most, (begin, end)), shape=(2 * k + 2, 2 * k + 2))
    rest = network - maximum_flow(network, 2 * k, 2 * k + 1).flow
    rest = rest.multiply(rest > 0).tocsr()
    rest.eliminate_zeros()
    reached = np.zeros(2 * k + 2, np.bool_)
    reached[breadth_first_order(rest, 2 * k, return_predecessors=False)] = True
    price = (np.where(reached[:k], 0.0, 1.0) + np.where(reached[k : 2 * k], 1.0, 0.0)) / 2.0
    least = float((price[row] + price[column]).min(initial=1.0))
    return price if least >= 1.0 else np.full(k, 0.5)  # half for each is always enough
