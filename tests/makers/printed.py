"""What of a print was printed more often than once, by what its controllers reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from decmcts.planning.running.recorded import Carried
from decmcts.print.plan import PlanDocument


def segments(document: PlanDocument, contours: Iterable[int]) -> Counter[tuple[float, ...]]:
    """Count the segments of beads, as files have them, whichever way they run."""
    found: Counter[tuple[float, ...]] = Counter()
    given = document.contours
    for c in contours:
        rows = slice(int(given.offsets[c]), int(given.offsets[c + 1]))
        points, laid = np.round(given.points[rows], 3) + 0.0, given.extrusion[rows][1:] > 0.0
        ends = np.concatenate([points[:-1], points[1:]], axis=1)[laid].tolist()
        found.update(tuple(row) if row[:3] <= row[3:] else (*row[3:], *row[:3]) for row in ends)
    return found


def printed_twice(plans: Sequence[Carried]) -> int:
    """Return how many segments of the first plan's contours were printed more often than once."""
    prints = [carried for carried in plans if carried.is_print]
    first = prints[0].document
    due = segments(first, range(len(first.contours)))
    done: Counter[tuple[float, ...]] = Counter()
    for carried in prints:
        done += segments(carried.document, [c for c, share in carried.printed() if share == 1.0])
    return sum(n - due[key] for key, n in done.items() if key in due and n > due[key])
