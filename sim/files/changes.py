"""Files in which tools change less often, or elsewhere, than in their source.

A change of tools is *alike* another between the same two tools if it commands the same, word for
word, and its filament is pulled above it and pushed behind it as much. Where it moves no axis and
has no bead of a wipe tower beside it, it may be left out, or stand between two other contours of
these tools. Which tool has to print what is the source's. So the order in which a file lays its
beads says where it has to change tools, and to which. What stands there must be what the source has
between these two tools.

All this is found from the moves and the text of the source by a reading of the judge's own.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode import Block, GcodeDocument, Motions
from decmcts.print.job import PrintJob
from sim.arrays import Floats, Ints
from sim.files.command_book import command_in

ALIKE_MM = 2e-3  # of filament; what differs less is alike: files round off


@dataclass(frozen=True, slots=True)
class Taken:
    """A source as a file takes it that changes tools elsewhere."""

    job: PrintJob  # with an epoch for each stretch with one tool of the file
    document: GcodeDocument  # with the blocks that have to stand in the file
    given: GcodeDocument  # as the source stands
    block: Ints  # (blocks of the document,) which of the source's each of them is
    loose: frozenset[int]  # the source's blocks that may be left out, or stand elsewhere

    def commands(self) -> Counter[bytes]:
        """Return how often more each command is due than it is in the source; below 0: less."""
        more = Counter[bytes]()
        for k in self.block.tolist():
            if k in self.loose:
                more.update(codes_of(self.given.blocks[k]))
        for k in self.loose:
            more.subtract(codes_of(self.given.blocks[k]))
        return more


def as_taken(printed: Ints, job: PrintJob, document: GcodeDocument, moves: Motions) -> Taken | None:
    """Return a source as a file takes it; None where the file changes tools as the source does.

    Also where it crosses what is no change of tools: then it is judged by the source as it stands.

    Parameters
    ----------
    printed
        The contours in the file's order, each once or more often in a row.
    """
    printed = printed[printed >= 0]
    loose = _loose(document, moves)
    if not loose or not len(printed):
        return None
    stretch, tools = _stretches(job, document, loose), np.asarray(job.contours.tool, np.int64)
    row, tool = stretch[printed], tools[printed]
    fewer = np.count_nonzero(np.diff(tool)) < np.count_nonzero(np.diff(tools))
    if not fewer or (np.diff(row) < 0).any():
        return None
    begins = np.diff(row, prepend=row[:1]) != 0
    changes = ~begins & (np.diff(tool, prepend=tool[:1]) != 0)
    places = np.flatnonzero(begins | changes).tolist()
    number = np.cumsum(begins | changes)
    due = _Due(document, loose, job, stretch)
    for k in places:
        pair = (int(tool[k - 1]), int(tool[k])) if changes[k] else None
        if not due.place(int(number[k]), pair, int(row[k])):
            return None
    due.rest(int(number[-1]) + 1)
    epoch = np.zeros(len(job.contours), np.int32)
    epoch[printed] = number
    return due.taken(epoch)


def _stretches(job: PrintJob, document: GcodeDocument, loose: frozenset[int]) -> Ints:
    """Return between which of the blocks that stay each contour lies, (n,)."""
    of_loose = {document.blocks[k].epoch for k in loose}
    epochs = np.asarray(job.contours.epoch, np.int64)
    own = [e for e in np.unique(epochs).tolist() if e not in of_loose and e > 0]
    return np.asarray(np.searchsorted(np.array(own, np.int64), epochs, side="right"))


class _Due:
    """The blocks that a file has to have, from its first line to its last."""

    def __init__(
        self, document: GcodeDocument, loose: frozenset[int], job: PrintJob, stretch: Ints
    ) -> None:
        self._document, self._loose, self._job = document, loose, job
        blocks = document.blocks
        pairs = [((blocks[k].begin.tool, blocks[k].end.tool), k) for k in sorted(loose)]
        self._of_pair = dict(reversed(pairs))
        self._walls = [k for k in range(len(blocks)) if k not in loose]
        self._first = np.full(int(stretch.max()) + 1, np.iinfo(np.int64).max)
        np.minimum.at(self._first, stretch, np.asarray(job.contours.epoch, np.int64))
        self._made: list[tuple[int, int]] = []  # epoch in the file, and block of the source
        self._stood = 0  # walls so far

    def place(self, epoch: int, pair: tuple[int, int] | None, stretch: int) -> bool:
        """Let tools change, or without `pair` a stretch begin; False: how is not known."""
        if pair is not None:
            block = self._of_pair.get(pair)
            self._made += [] if block is None else [(epoch, block)]
            return block is not None
        while self._stood < len(self._walls):
            wall = self._walls[self._stood]
            if self._document.blocks[wall].epoch > self._first[stretch]:
                break
            self._made.append((epoch, wall))
            self._stood += 1
        return True

    def rest(self, epoch: int) -> None:
        """Let all blocks stand that are left: below the last bead."""
        self._made += [(epoch, wall) for wall in self._walls[self._stood :]]

    def taken(self, epoch: NDArray[np.int32]) -> Taken:
        """Return the source so, with these epochs of its contours."""
        job, blocks = self._job, self._document.blocks
        refills = {e for e, k in self._made if blocks[k].epoch in job.refills}
        job = replace(
            job, contours=replace(job.contours, epoch=epoch), refills=tuple(sorted(refills))
        )
        anew = tuple(replace(blocks[k], epoch=e) for e, k in self._made)
        which = np.array([k for _, k in self._made], np.int64)
        document = replace(self._document, blocks=anew)
        return Taken(job, document, self._document, which, self._loose)


def _loose(document: GcodeDocument, moves: Motions) -> frozenset[int]:
    """Return the changes of a source that are alike most between the same two tools."""
    alone = Counter(block.epoch for block in document.blocks)
    kinds = defaultdict[tuple[int, int], list[tuple[int, tuple[bytes, ...], Floats]]](list)
    for k, block in enumerate(document.blocks):
        begin, end = block.begin, block.end
        changes = begin.tool != end.tool and begin.relative_e == end.relative_e
        if not changes or block.tower or block.edge or alone[block.epoch] > 1:
            continue
        if (found := _filament(moves, block)) is not None:
            kinds[begin.tool, end.tool].append((k, codes_of(block), found))
    loose = set[int]()
    for of_pair in kinds.values():
        words = Counter(codes for _, codes, _ in of_pair).most_common(1)[0][0]
        usual = np.median([net for _, codes, net in of_pair if codes == words], axis=0)
        loose |= {
            k for k, codes, net in of_pair
            if codes == words and np.abs(net - usual).max() <= ALIKE_MM
        }  # fmt: skip
    return frozenset(loose)


def _filament(moves: Motions, block: Block) -> Floats | None:
    """Return what is pushed less what is pulled above and below a change; None: it moves axes.

    From the bead above it, and to the bead behind it.
    """
    a, b = _rows(moves, block)
    points = np.asarray(moves.points)[a : b + 1]
    if b > a and (points != points[0]).any():
        return None
    begin, end = _gap(moves, a, b)
    pushed = np.asarray(moves.extrusion)
    return np.array([pushed[begin:a].sum(), pushed[b:end].sum()])


def _rows(moves: Motions, block: Block) -> tuple[int, int]:
    """Return the first move of a block and the first behind it."""
    found = np.searchsorted(np.asarray(moves.line), (block.line, block.last_line + 1))
    return int(found[0]), int(found[1])


def _gap(moves: Motions, begin: int, end: int) -> tuple[int, int]:
    """Return these moves with all up to the beads above and below them."""
    of = np.asarray(moves.contour)
    while begin > 0 and of[begin - 1] < 0:
        begin -= 1
    while end < len(of) and of[end] < 0:
        end += 1
    return begin, end


def gap_filament(moves: Motions, block: Block, tools: Ints, most: int) -> Floats:
    """Return what each tool pushes less what it pulls from the bead above a block to that behind.

    (most,) mm.
    """
    begin, end = _gap(moves, *_rows(moves, block))
    pushed = np.asarray(moves.extrusion)[begin:end]
    return np.bincount(tools[begin:end], pushed, most).astype(np.float64)


def codes_of(block: Block) -> tuple[bytes, ...]:
    """Return what a block commands, without comments."""
    return tuple(code for row in block.text.split(b"\n") if (code := command_in(row)))
