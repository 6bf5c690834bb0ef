"""Files that take heads to their parks where a print was broken off, read back and judged.

They are carried out one after the other, in the order in which they are given. Where a head
stands is known but for a line on which it is somewhere; all of that line is moved. What each part
of a head passes then is a convex body, and none may come near the parts of another head, wherever
on its own line that stands by then, nor touch what is printed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.formats.gcode.text.lines import command_of
from decmcts.print.contours import Contours, taken
from decmcts.print.machine import Body, Head, Machine
from decmcts.print.plan import NO_CONTOUR, PlanDocument
from sim.faults import LIMIT, Fault, FaultKind, Verdict
from sim.replay.bodies import around, near_boxes
from sim.replay.material import find_contacts, place_of
from sim.replay.shapes import Solid, as_material, beads_there, parts_of, separations_between

ROUNDED_MM = 1.1e-3  # files have three decimals
_HEADER = re.compile(rb"^; head (\S.*), file (\d+) of (\d+): to its park[ \t]*\r?$", re.M)
_MOVE = re.compile(rb"G1(?: X(-?\d+\.\d+))?(?: Y(-?\d+\.\d+))?(?: Z(-?\d+\.\d+))? F([1-9]\d*)\Z")
_BEGIN, _END = [b"G21", b"G90"], b"M400"


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """Where a head stands: somewhere on a line."""

    line: Floats  # (k, 3) mm; one point: there
    contour: int = NO_CONTOUR  # of the plan, within which it broke off
    moves: bool = True  # it may be taken to its park; False: it is fenced

    @property
    def pieces(self) -> Floats:
        """Begin and end of each piece of the line, (n, 2, 3)."""
        if len(self.line) == 1:
            return np.stack([self.line, self.line], axis=1)
        return np.stack([self.line[:-1], self.line[1:]], axis=1)


def check_to_park(
    files: Sequence[bytes], document: PlanDocument, machine: Machine, done: Flags,
    standing: Mapping[str, Whereabouts],
) -> Verdict:  # fmt: skip
    """Check the texts of files that take heads to their parks, in the order to run them.

    `document` is the plan that was broken off, `done` its contours that are printed, or broken
    off, (n,). The machine has all heads, those that print no more too; `standing` says where.
    """
    replay = _Replay(document, machine, done, {n: one.pieces for n, one in standing.items()})
    faults = list[Fault]()
    for k, text in enumerate(files):
        try:
            name, moves = _read(text, k + 1, len(files))
        except ValueError as error:
            return Verdict((*faults, Fault(FaultKind.COMMAND, f"file {k + 1}: {error}")))
        if name not in standing or not standing[name].moves:
            faults.append(Fault(FaultKind.COMMAND, f"file {k + 1}: head {name} is not to move"))
            break
        faults += replay.take(name, moves, standing[name].contour)
    for name, one in standing.items():
        off = np.abs(replay.pieces[name] - np.array(machine.head(name).park)).max()
        if one.moves and off > ROUNDED_MM:
            faults.append(Fault(FaultKind.NOT_PARKED, f"head {name} does not come to its park"))
    return Verdict(tuple(faults), {"files": float(len(files))})


def _read(text: bytes, place: int, count: int) -> tuple[str, list[Floats]]:
    """Return the head a file is for, and where each move ends, NaN: as it was.

    Raises
    ------
    ValueError
        For anything but moves up and across, in mm and absolute.
    """
    header = _HEADER.search(text)
    if header is None or (int(header[2]), int(header[3])) != (place, count):
        raise ValueError(f"it does not say that it is file {place} of {count}")
    codes = [code for code in map(command_of, text.splitlines()) if code]
    if codes[:2] != _BEGIN or codes[-1] != _END:
        raise ValueError("it does not begin in mm, absolute, or does not wait for its end")
    moves = list[Floats]()
    for code in codes[2:-1]:
        found = _MOVE.match(code)
        if found is None:
            raise ValueError(f"'{code[:60].decode('utf-8', 'replace')}' is no move to a park")
        words = [np.nan if word is None else float(word) for word in found.groups()[:3]]
        moves.append(np.array(words, np.float64))
    if not moves or np.isfinite(moves[0]).tolist() != [False, False, True]:
        raise ValueError("it does not go up before all else")
    return header[1].decode("utf-8", "replace"), moves


@dataclass(slots=True)
class _Replay:
    """Heads that are moved one after the other, and what stands on the bed."""

    document: PlanDocument
    machine: Machine
    done: Flags  # (n,) contours that are printed
    pieces: dict[str, Floats]  # of each head the line on which it stands, (k, 2, 3)

    def take(self, name: str, moves: Sequence[Floats], contour: int) -> list[Fault]:
        """Move a head and return what is wrong with that; `contour` is the one it broke off in."""
        head, faults = self.machine.head(name), list[Fault]()
        for k, words in enumerate(moves):
            begin = self.pieces[name]
            end = np.where(np.isnan(words), begin, words)
            swept = np.concatenate([begin, end], axis=1)
            self.pieces[name] = end
            faults += self._heads(head, swept)
            if k == 0:
                faults += self._goes_up(head, begin, end, contour)
            else:
                faults += self._goes_on(head, begin, end)
        return faults

    def _heads(self, head: Head, swept: Floats) -> Iterator[Fault]:
        """Yield which heads a head comes too near to; `swept` has corners of its way, (n, 4, 3)."""
        for name, others in self.pieces.items():
            other = self.machine.head(name)
            if name == head.name:
                continue
            for axis, side, least in separations_between(self.machine, head, other):
                mine, its = swept[..., axis], others[..., axis]
                gap = its.min() - mine.max() if side > 0.0 else mine.min() - its.max()
                if gap < least - ROUNDED_MM:
                    text = f"heads {head.name} and {name} may be {gap:.3f} mm apart along "
                    text += f"{'xy'[axis]}, less than {least:g} mm"
                    yield Fault(FaultKind.RAIL, text)
            if met := self._meets(head, swept, other, others):
                yield Fault(FaultKind.HEAD_HEAD, met)

    def _meets(self, head: Head, swept: Floats, other: Head, others: Floats) -> str:
        """Return in words where a head comes too near to another; empty: it does not."""
        reach = self.machine.head_clearance_mm - ROUNDED_MM
        for mine, its in product(parts_of(head), parts_of(other)):
            a, b = mine.vertices(), its.vertices()
            for i, near in near_boxes(around(swept, a), around(others, b), reach):
                ours, theirs = _solid(a, swept[i]), [_solid(b, others[j]) for j in near]
                if any(ours.touches(each) or ours.distance(each) < reach for each in theirs):
                    row = np.concatenate([swept[i, 0], swept[i, -1]])
                    return (
                        f"head {head.name} ({mine.name}) may come too near to head {other.name} "
                        f"({its.name}) at {place_of(row)}"
                    )
        return ""

    def _goes_up(self, head: Head, begin: Floats, end: Floats, contour: int) -> Iterator[Fault]:
        """Yield what is wrong with the first move, which leads up from wherever the head stands."""
        rise = float((end - begin)[..., 2].max())
        if (end < begin)[..., 2].any():
            text = f"head {head.name} may go down before it goes across"
            yield Fault(FaultKind.HEAD_MATERIAL, text)
        if rise <= 0.0 or not head.bodies:
            return
        raised = [  # what lies between is where the head stood, as the plan had it
            Body(b.name, (*b.minimum[:2], b.maximum[2]), (*b.maximum[:2], b.maximum[2] + rise))
            for b in head.bodies
        ]
        bare = replace(head, slices=(), bodies=tuple(raised))  # slices fill all above them anyway
        yield from self._touched(bare, begin.reshape(-1, 6), contour)

    def _goes_on(self, head: Head, begin: Floats, end: Floats) -> Iterator[Fault]:
        lowest = float(min(begin[..., 2].min(), end[..., 2].min()))
        lowest += min([0.0, *(part.low for part in parts_of(head))])
        tops = (float(one.points[:, 2].max()) for one in self._printed())
        if lowest >= max(tops, default=-np.inf) - ROUNDED_MM:
            return
        if (begin != begin[0, 0]).any():
            text = f"head {head.name} goes lower than what is printed where it is not known"
            yield Fault(FaultKind.HEAD_MATERIAL, text)
            return
        yield from self._touched(head, np.hstack([begin[:1, 0], end[:1, 0]]), NO_CONTOUR)

    def _printed(self, but: int = NO_CONTOUR) -> list[Contours]:
        rows = np.flatnonzero(self.done)
        mine = taken(self.document.contours, rows[rows != but])
        before = self.document.printed
        return [one for one in (mine, before) if one is not None and len(one)]

    def _touched(self, head: Head, moves: Floats, but: int) -> Iterator[Fault]:
        for printed in self._printed(but):
            beads = as_material(beads_there(printed), self.machine, ROUNDED_MM)
            for met in find_contacts(
                moves, beads, head, clearance_mm=self.machine.clearance_mm,
                tolerance_mm=ROUNDED_MM, limit=LIMIT,
            ):  # fmt: skip
                text = f"head {head.name} ({met.part}) meets what is printed at "
                yield Fault(FaultKind.HEAD_MATERIAL, text + place_of(moves[met.move]))


def _solid(shape: Floats, places: Floats) -> Solid:
    """Return all that a convex shape fills whose tip is at any of these places or in between."""
    return Solid(np.concatenate([shape + place for place in places]))
