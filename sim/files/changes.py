"""Files in which tools change less often, or elsewhere, than in their source.

docs/gcode.md (*Fewer changes of tools, where one head has several*) says which changes are alike
and may be left out. Which tool has to print what is the source's. So the order in which a file lays
its beads says where it has to change tools, and to which. What stands there must be what the source
has between these two tools.

All this is found from the moves and the text of the source by a reading of the judge's own.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.formats.gcode import Block, GcodeDocument, Motions
from decmcts.print.job import PrintJob
from sim.files.commands import command_in

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
    `printed` are the contours in the file's order, each once or more often in a row.
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
    places, number = np.flatnonzero(begins | changes), np.cumsum(begins | changes)
    first = np.full(int(stretch.max()) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, stretch, np.asarray(job.contours.epoch, np.int64))
    pairs = [(int(tool[k - 1]), int(tool[k])) if changes[k] else None for k in places]
    made = _made(document, loose, number[places].tolist(), pairs, first[row[places]].tolist())
    if made is None:
        return None
    epoch = np.zeros(len(job.contours), np.int32)
    epoch[printed] = number
    blocks = document.blocks
    refills = {e for e, k in made if blocks[k].epoch in job.refills}
    job = replace(job, contours=replace(job.contours, epoch=epoch), refills=tuple(sorted(refills)))
    anew = tuple(replace(blocks[k], epoch=e) for e, k in made)
    which = np.array([k for _, k in made], np.int64)
    return Taken(job, replace(document, blocks=anew), document, which, loose)


def _made(
    document: GcodeDocument, loose: frozenset[int], numbers: list[int],
    pairs: list[tuple[int, int] | None], firsts: list[int],
) -> list[tuple[int, int]] | None:  # fmt: skip
    """Return the blocks that a file has to have, in its order: epoch of the file, and which it is.

    None where it changes tools as the source never does. `numbers` are epochs of the file that
    begin with a change of tools (`pairs`) or in another stretch (None), `firsts` the least epoch
    of the source in each's stretch.
    """
    blocks, made, stood = document.blocks, list[tuple[int, int]](), 0
    walls = [k for k in range(len(blocks)) if k not in loose]
    of_pair = {(blocks[k].begin.tool, blocks[k].end.tool): k for k in sorted(loose, reverse=True)}
    for number, pair, first in zip(numbers, pairs, firsts, strict=True):
        if pair is None:
            while stood < len(walls) and blocks[walls[stood]].epoch <= first:
                made.append((number, walls[stood]))
                stood += 1
        elif pair in of_pair:
            made.append((number, of_pair[pair]))
        else:
            return None
    last = numbers[-1] if numbers else 0
    return made + [(last + 1, wall) for wall in walls[stood:]]  # below the last bead


def _stretches(job: PrintJob, document: GcodeDocument, loose: frozenset[int]) -> Ints:
    """Return between which of the blocks that stay each contour lies, (n,)."""
    of_loose = {document.blocks[k].epoch for k in loose}
    epochs = np.asarray(job.contours.epoch, np.int64)
    own = [e for e in np.unique(epochs).tolist() if e not in of_loose and e > 0]
    return np.asarray(np.searchsorted(np.array(own, np.int64), epochs, side="right"))


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
