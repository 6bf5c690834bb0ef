"""How far the nozzle travels unretracted, against the source: filament oozes there.

Where a file does not retract between two beads, it travels no farther than the source does where it
does not, or less far than the next longer way on which the source retracts. docs/gcode.md has the
other rules (*What the judge accepts*). Counted from the moves alone, as all of `sim.files.ledger`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Ints

PULLED_MM = 0.01  # of filament that counts as retracted, or more:
ENOUGH = 0.5  # as this share of the least that the source retracts with that tool
WIPED = 1e-3  # mm of filament a mm of way; what pulls less is a travel and no wipe
SHORT_MM = 5.0  # so far the nozzle may travel where the source never retracts on longer ways
SAME_MM = 0.02  # by which ways may differ: coordinates are rounded
JUST_MM = 1e-4  # less than a way on which the source retracts


class Spans(NamedTuple):
    """Moves between two beads: begin..end - 1, each (n,)."""

    begin: Ints
    end: Ints
    tool: Ints  # that prints the second one
    plain: Flags  # the first one too, and no lines of the source stand in between


class Ways(NamedTuple):
    """How the nozzle gets from bead to bead, each (n,)."""

    tool: Ints
    plain: Flags  # as `Spans`
    retracts: Flags  # on the way
    unretracted: Floats  # mm across the bed with nothing retracted
    distance: Floats  # mm from end to end
    enough: Mapping[int, float]  # by tool, mm of filament that count as retracted

    @staticmethod
    def of(
        points: Floats, extrusion: Floats, withdrawn: Flags, spans: Spans,
        enough: Mapping[int, float], *, parted: bool = False, already: Floats | None = None,
    ) -> Ways:  # fmt: skip
        """Measure ways; linear in the moves.

        Parameters
        ----------
        points : (m + 1, 3)
        extrusion : (m,) mm of filament
        withdrawn : (m,) whether the firmware has retracted before each move
        enough : what counts as retracted, mm of filament by tool
        parted
            Ways are made of several travels: the longest move unretracted counts, not their sum.
        already : (n,) mm retracted where each way begins; None: nothing
        """
        begin, end = spans.begin, spans.end
        total = np.concatenate([[0.0], np.cumsum(extrusion)])
        step = np.hypot(*np.diff(points[:, :2], axis=0).T)
        count, n = end - begin, len(begin)
        way = np.repeat(np.arange(n), count)
        move = np.arange(len(way)) + np.repeat(begin - np.cumsum(count) + count, count)
        pulled = np.array([enough.get(t, PULLED_MM) for t in spans.tool.tolist()])
        floor = total[begin] - pulled + (0.0 if already is None else already)
        held = withdrawn[move] | (total[move] < floor[way])
        unretracted = np.zeros(n)
        bare = ~held & (np.abs(extrusion[move]) < np.maximum(WIPED * step[move], 1e-6))
        (np.maximum if parted else np.add).at(unretracted, way, step[move] * bare)
        return Ways(
            spans.tool, spans.plain, np.bincount(way, held, n) > 0, unretracted,
            np.asarray(np.linalg.norm(points[end] - points[begin], axis=1)), enough,
        )  # fmt: skip


def enough_of(extrusion: Floats, spans: Spans) -> dict[int, float]:
    """Return what counts as retracted with each tool of a source, mm, by the ways it goes."""
    total, (begin, end, tool, plain) = np.cumsum(np.append(0.0, extrusion)), spans
    depth = np.zeros(len(begin))
    if len(begin):
        pairs = np.stack([begin, end + 1], axis=1).ravel()
        depth = total[begin] - np.minimum.reduceat(np.append(total, np.inf), pairs)[::2]
    pulls = plain & (depth > PULLED_MM)
    return {
        t: max(PULLED_MM, ENOUGH * float(depth[pulls & (tool == t)].min()))
        for t in np.unique(tool[pulls]).tolist()
    }


def farther_unretracted(ours: Ways, theirs: Ways, *, parted: bool = False) -> dict[int, str]:
    """Return, in words, the ways on which a file goes unretracted farther than its source.

    Tools that the source never retracts are not judged. With `parted` a way may be several
    travels, some of them too short to retract for.
    """
    shown = theirs.plain & theirs.retracts
    pulling = np.unique(theirs.tool[shown]).tolist()
    own = np.isin(theirs.tool, pulling)
    bare = theirs.unretracted[own & ~theirs.retracts].max(initial=0.0)
    longer = theirs.distance[own & theirs.retracts & (theirs.distance > bare)]
    short = max(bare, (longer.min() - JUST_MM if len(longer) else SHORT_MM) - SAME_MM)
    most = {t: theirs.unretracted[shown & (theirs.tool == t)].max() for t in pulling}
    if parted:
        most = {tool: max(mm, short) for tool, mm in most.items()}
    found = {}
    for k in np.flatnonzero(ours.plain & np.isin(ours.tool, pulling)).tolist():
        pulls = bool(ours.retracts[k])
        limit = most[int(ours.tool[k])] if pulls else short
        if ours.unretracted[k] > limit + SAME_MM:
            found[k] = (
                f"the nozzle travels {ours.unretracted[k]:.4g} mm unretracted, in the source "
                f"{limit:.4g} at most where it {'retracts' if pulls else 'does not'}"
            )
    return found
