"""Mutants of the filament of several tools, in the file of one head or in files of several."""

from __future__ import annotations

from tests.mutants.catalogue import Mutant, pick
from tests.mutants.gcode_lines import (
    BEAD,
    PRIME,
    Files,
    Lines,
    Rng,
    Spoil,
    change,
    in_one,
    remove,
    rows_of,
)  # fmt: skip


def other_retraction(own: str, other: str) -> Spoil:
    """Return a mutant that lets a tool retract, and push back, as far as another does."""

    def spoil(lines: Lines, rng: Rng) -> None:
        pairs = [k for k in rows_of(lines, rf"^G1 E-{own}") for j in (_pushed(lines, k),)
                 if lines[j].startswith(f"G1 E{own}")]  # fmt: skip
        k = pick(pairs, rng)
        for row in (k, _pushed(lines, k)):
            lines[row] = lines[row].replace(own, other)

    return spoil


def _pushed(lines: Lines, pulled: int) -> int:
    """Return the next line that pushes filament alone."""
    return next((k for k in rows_of(lines, PRIME) if k > pulled), pulled)


def pushes_exchanged(lines: Lines, rng: Rng) -> None:
    """Let one tool push half a millimetre less and the other more: together nothing is lost."""
    a, b = pick(rows_of(lines, r"^G1 E0\.80"), rng), pick(rows_of(lines, r"^G1 E2\.03"), rng)
    lines[a] = lines[a].replace("E0.80", "E0.30")
    lines[b] = lines[b].replace("E2.03", "E2.53")


def pull_behind_its_macro(lines: Lines, rng: Rng) -> None:
    """Pull behind the macro that should push back."""
    k = pick(rows_of(lines, r"^CLEAN_NOZZLE"), rng)
    lines[k - 1], lines[k] = lines[k], lines[k - 1]


def by_firmware(lines: Lines, rng: Rng) -> None:
    """Leave one retraction to a firmware that may know none."""
    rows = [
        k for k in rows_of(lines, r"^G1 E-0\.80") if lines[_pushed(lines, k)].startswith("G1 E0.80")
    ]
    k = pick(rows, rng)
    lines[_pushed(lines, k)], lines[k] = "G11", "G10"


TOOL_MUTANTS: tuple[Mutant[Lines], ...] = (  # of the made print with two tools
    Mutant("a tool's first push dropped", remove(r"^G1 E10\.")),
    Mutant("a tool retracts as far as the other", other_retraction("0.80000", "2.00000")),
    Mutant("a tool retracts as far as for a change", other_retraction("0.80000", "10.00000")),
    Mutant("a pull behind the macro that pays it", pull_behind_its_macro),
    Mutant("a push back before a macro that pays", change(r"^CLEAN", r"^", "G1 E1.50000\n")),
    Mutant("a push on the spot dropped", change(r"^G1 E0\.9", "E0.9", "E0.8")),
    Mutant("a push on the spot doubled", change(r"^G1 E0\.9", "E0.9", "E1.0")),
    Mutant("a restart distance dropped", change(r"^G1 E2\.03", "E2.03", "E2.00")),
    Mutant("pushes of two tools exchanged", pushes_exchanged),
    Mutant("a retraction left to the firmware", by_firmware),
)


def push_to_the_other(files: Files, rng: Rng) -> None:
    """Let one head push half a millimetre less, and the head of the other tool as much more."""
    a, b = (
        pick(rows_of(lines, pattern), rng)
        for lines, pattern in zip(files, (r"^G1 E0\.80", r"^G1 E2\.03"), strict=True)
    )
    files[0][a] = files[0][a].replace("E0.80", "E0.30")
    files[1][b] = files[1][b].replace("E2.03", "E2.53")


def line_to_the_other(files: Files, rng: Rng) -> None:
    """Take a push out of one head's file and put it into the other's, at its first push."""
    a = pick(rows_of(files[0], r"^G1 E0\.80"), rng)
    files[1].insert(rows_of(files[1], PRIME)[0], files[0].pop(a))


def extra_for_another_bead(lines: Lines, rng: Rng) -> None:
    """Push for one bead what is due before another."""
    a, b = pick(rows_of(lines, r"^G1 E0\.[19]0"), rng), pick(rows_of(lines, r"^G1 E0\.80"), rng)
    lines[a] = lines[a].replace("E0.90", "E0.80").replace("E0.10", "E0.00")
    lines[b] = lines[b].replace("E0.80", "E0.90")


def beads_by_the_other(files: Files, rng: Rng) -> None:
    """Let the head of one tool print all beads of a contour of the other."""
    rows = rows_of(files[0], BEAD)
    first = pick([k for k in rows if k - 1 not in rows], rng)
    last = first
    while last in rows:
        last += 1
    files[1][(at := rows_of(files[1], BEAD)[-1] + 1) : at] = files[0][first:last]
    del files[0][first:last]


def colder_for_a_bead(lines: Lines, rng: Rng) -> None:
    """Cool the hot end before a contour, as sources do while the other tool prints."""
    lines.insert(pick(rows_of(lines, BEAD), rng), "M104 S150")


def as_hot_as_the_other(lines: Lines, rng: Rng) -> None:
    """Wait for another temperature at the start."""
    k = pick(rows_of(lines, r"^M109 S"), rng)
    lines[k] = "M109 S190"


def idle_push(lines: Lines, rng: Rng) -> None:
    """Push before a bead as if the head had stood idle."""
    k = pick(rows_of(lines, r"^G1 E0\.80|^G1 E2\.03"), rng)
    lines.insert(k + 1, "G1 E0.30000 F2100")


HEAD_TOOL_MUTANTS: tuple[Mutant[Files], ...] = (  # of the made print with two tools, a head each
    Mutant("a push dropped in one head's file", in_one(remove(r"^G1 E2\.03"))),
    Mutant("a head's restart distance dropped", in_one(change(r"^G1 E2\.03", "E2.03", "E2.00"))),
    Mutant("a head's first push dropped", in_one(remove(r"^G1 E10\."))),
    Mutant("a head's retraction doubled", in_one(change(r"^G1 E-0\.80", "E-0.80", "E-1.60"))),
    Mutant("a push given to the other tool", push_to_the_other),
    Mutant("a push in the other head's file", line_to_the_other),
    Mutant("filament for one bead given to another", in_one(extra_for_another_bead)),
    Mutant("a head retracts as the other", in_one(other_retraction("0.80000", "2.00000"))),
    Mutant("a contour printed by the other tool", beads_by_the_other),
    Mutant("a head colder for one contour", in_one(colder_for_a_bead)),
    Mutant("a head as hot as the other tool", in_one(as_hot_as_the_other)),
    Mutant("a push for idling where it did not idle", in_one(idle_push)),
)


def change_to_itself(lines: Lines, rng: Rng) -> None:
    """Choose the tool again that is in use: the other's beads are laid with it."""
    k = pick(rows_of(lines, r"^T[01]$")[1:], rng)
    lines[k] = "T1" if lines[k] == "T0" else "T0"


def change_dropped(lines: Lines, rng: Rng) -> None:
    """Leave a change out, with what it tells the hot ends."""
    k = pick(rows_of(lines, r"^T[01]$")[1:], rng)
    del lines[k - 1 : k + 2]


def changes_exchanged(lines: Lines, rng: Rng) -> None:
    """Let two changes stand for each other, the text of one pair of tools for that of another."""
    a, b = rows_of(lines, r"^T[01]$")[-2:]
    lines[a - 1 : a + 2], lines[b - 1 : b + 2] = lines[b - 1 : b + 2], lines[a - 1 : a + 2]


def change_later(lines: Lines, rng: Rng) -> None:
    """Let a change stand below the first bead that is the next tool's."""
    k = pick(rows_of(lines, r"^T[01]$")[1:], rng)
    bead = next(j for j in rows_of(lines, BEAD) if j > k)
    rows = lines[k - 1 : k + 2]
    lines[bead + 1 : bead + 1] = rows
    del lines[k - 1 : k + 2]


def change_there_and_back(lines: Lines, rng: Rng) -> None:
    """Change to the other tool and back where nothing is printed between."""
    rows = rows_of(lines, r"^T[01]$")
    a, b = (lines[k - 1 : k + 2] for k in rows[-2:])
    at = pick([k for k in rows_of(lines, r"^G1 E-0\.80") if k > rows[-1]], rng) + 1
    lines[at:at] = [*a, *b]


def bead_of_the_other(lines: Lines, rng: Rng) -> None:
    """Print a bead of one tool among those of the other."""
    last = rows_of(lines, r"^T[01]$")[-1]
    a = pick([k for k in rows_of(lines, BEAD) if k > last], rng)
    b = pick([k for k in rows_of(lines, BEAD) if k < last], rng)
    lines.insert(b + 1, lines.pop(a))


CHANGE_MUTANTS: tuple[Mutant[Lines], ...] = (  # of the made print with parts of two colours
    Mutant("a change to the other tool", change_to_itself),
    Mutant("a change dropped", change_dropped),
    Mutant("the texts of two changes exchanged", changes_exchanged),
    Mutant("a change behind the next tool's first bead", change_later),
    Mutant("a change there and back for nothing", change_there_and_back),
    Mutant("a bead printed by the other tool", bead_of_the_other),
    Mutant("a change as hot as for the other tool", change(r"^M109 S205 T0", "S205", "S210")),
    Mutant("a change as hot as on the first layer", change(r"^M109 S205 T0", "S205", "S215")),
    Mutant("a change that heats the other tool", change(r"^M109 S205 T0", "T0", "T1")),
    Mutant("a change that waits for no heat", change(r"^M109 S205 T0", "M109", "M104")),
    Mutant("what a change cools stays hot", remove(r"^M104 S15[05] T")),
    Mutant("a change's push dropped", remove(r"^G1 E10\.1")),
    Mutant("a change primes less", change(r"^G1 E10\.1", r"E10\.1\d*", "E10.00000")),
    Mutant("a change pulls less", change(r"^G1 E-10", "E-10", "E-9")),
)
