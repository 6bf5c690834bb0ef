"""Epochs that begin where machine state does, although no line is a barrier.

The first layer when cooling is another after it, and the place where a command
sets something for the first time: what held before cannot be set again. And where dots and
vertical beads of a tool begin and end: pushed right above or below a tool change they would
look like its purge.
"""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.formats.gcode.controller.held import WordKey, keys_of
from decmcts.formats.gcode.controller.state import Track
from decmcts.formats.gcode.dialects.dialect import GROWING
from decmcts.formats.gcode.document import BEFORE_TRAVEL, DESCRIBES, SILENT, UNSET
from decmcts.formats.gcode.reading.beads import Parsed
from decmcts.formats.gcode.reading.grouping import DOT_MM, REFILLS, RESTART_MM, beyond_retracted

DOWN_MM = 1e-3  # heights nearer than that are one
_WHOLE: WordKey = ("", "")  # what a command sets that is said whole


def state_edges(parsed: Parsed) -> tuple[Flags, Flags]:
    """Return the contours an epoch begins at, and those that set something first, (n,) bool.

    The latter run one way only: reversed, what holds behind the command would hold
    before it, and what is not set yet cannot be set back. So does a first bead that is primed
    where it begins.
    """
    motion, runs, track = parsed.motion, parsed.runs, parsed.track
    edge, one_way = np.zeros(len(runs), np.bool_), np.zeros(len(runs), np.bool_)
    first = track.table.rows[track.at(motion.line[runs.first])]
    last = track.table.rows[track.at(motion.line[runs.last])]
    _mark_first_layer(edge, parsed)
    for k, slot in enumerate(track.table.slots):
        used = np.unique([first[:, k], last[:, k]])
        ends = [track.table.leave[value] for value in used.tolist() if value != UNSET]
        can_be_left = slot in BEFORE_TRAVEL and all(ends)  # of an object's or label's values each
        if slot in DESCRIBES or slot.startswith(SILENT) or can_be_left:
            continue
        sets, grows = _growth(track, used)
        if not grows.any():
            continue
        begin, end = sets[first[:, k]], sets[last[:, k]]
        within = grows[begin, end]
        one_way |= within
        edge |= within  # set within this contour: it ends its epoch
        edge[1:] |= within[:-1] | grows[end[:-1], begin[1:]]
    _mark_dots(edge, parsed)
    one_way[0] |= _is_primed(parsed)
    edge[0] = False
    return edge, one_way


def _is_primed(parsed: Parsed) -> bool:
    """Tell whether the first bead is primed where it begins, behind the first layer's marker.

    That push is start code: begun elsewhere, the bead would leave it behind as a dot.
    """
    motion, runs = parsed.motion, parsed.runs
    if not len(parsed.track.layer_lines):
        return False
    before = slice(int(motion.before[runs.body]), int(runs.first[0]))
    surplus, pushed = beyond_retracted(motion)[before], motion.extrusion[before]
    still = (np.diff(motion.points, axis=0)[before] == 0.0).all(axis=1)
    restarts = (pushed > surplus + DOT_MM) & (surplus <= RESTART_MM)
    return bool((still & (surplus > DOT_MM) & ~restarts).any())


def _mark_dots(edge: Flags, parsed: Parsed) -> None:
    """Mark in place the first dot between two tool changes, and what follows the last."""
    motion, runs, track = parsed.motion, parsed.runs, parsed.track
    refills = track.stops(REFILLS)
    if not len(refills):
        return
    moves = np.flatnonzero(runs.contour >= 0)
    delta = motion.points[moves + 1, :2] - motion.points[moves, :2]
    spots = np.ones(len(runs), np.bool_)
    spots[runs.contour[moves[(delta != 0.0).any(axis=1)]]] = False
    stretch = np.searchsorted(refills, motion.line[runs.first])
    dots = np.flatnonzero(spots)
    begins = np.flatnonzero(np.diff(stretch[dots], prepend=-1))
    edge[dots[begins]] = True
    behind = dots[np.append(begins[1:], len(dots)) - 1] + 1 if len(dots) else dots
    edge[behind[behind < len(runs)]] = True


def _growth(track: Track, used: Int32s) -> tuple[Ints, Flags]:
    """Return what each used value sets, (n_values,) numbers, and which sets more than which.

    The latter by number, [from, to]: nothing can be set back from what sets more. What another
    tool has left sets nothing of the one in use.
    """
    sets, numbers = np.zeros(len(track.table.values), np.int64), dict[frozenset[WordKey], int]()
    for k in used.tolist():
        text = track.table.values[k]
        keys = frozenset[WordKey]()
        if k != UNSET and k not in track.left:
            keys = keys_of(text) if text.split(maxsplit=1)[0] in GROWING else frozenset([_WHOLE])
        sets[k] = numbers.setdefault(keys, len(numbers))
    grows = [[bool(more - keys) for more in numbers] for keys in numbers]
    return sets, np.array(grows, np.bool_)


def _mark_first_layer(edge: Flags, parsed: Parsed) -> None:
    """Mark in place where the second layer begins, if cooling is another there.

    Not where the print comes down again to the first, for the next of several parts, nor where the
    first does not lie on the bed, as in what is left of a print.
    """
    motion, runs, track, beads = parsed.motion, parsed.runs, parsed.track, parsed.beads
    later = np.flatnonzero(beads.layer > 0)
    fans = [k for k, slot in enumerate(track.table.slots) if slot.startswith("fan")]
    if not len(later) or not later[0] or not fans:
        return
    z = motion.points[runs.last + 1, 2]
    if (beads.layer[later[0] :] == 0).any() or z[later[0] :].min() < z[: later[0]].max() + DOWN_MM:
        return
    low = int(np.argmin(z[: later[0]]))
    if z[low] - beads.height[low] > beads.height[low] - DOWN_MM:  # a layer fits below it
        return
    moves = np.flatnonzero(runs.contour >= 0)
    state, below = track.at(motion.line[moves]), runs.contour[moves] < later[0]
    first, rest = (
        {
            tuple(row)
            for row in track.table.rows[np.flatnonzero(np.bincount(states))][:, fans].tolist()
        }
        for states in (state[below], state[~below])
    )
    edge[later[0]] = first != rest
