"""What goes in comes out: each tool's filament, between every two beads, judged by its source."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.experiments.made_print import made_gcode
from decmcts.formats.gcode import read_gcode, read_motions, write_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.verify import verify
from decmcts.print.toolpath import Toolpath
from sim.faults import FaultKind
from sim.files.written import verify_written
from tests.direct_actions import direct_actions
from tests.makers.two_tools import made_tools_gcode
from tests.mutants.catalogue import NotHereError
from tests.mutants.gcode import GCODE_MUTANTS
from tests.mutants.tools import TOOL_MUTANTS

MACHINE = "mk4s"
HEAD = "; by hand\nM104 S215\nG28\nG90\nM83\n"


def written(source: Path, out: Path, order=None, is_reversed=None):
    """Write a source in an order, its own unless said."""
    job, document = read_gcode(source)
    n = len(job.contours)
    order = np.arange(n) if order is None else order
    turned = np.zeros(n, np.bool_) if is_reversed is None else is_reversed
    path = Toolpath.of(np.asarray(order, np.int32), turned)
    write_gcode(document, job, direct_actions(job, path), out)
    return job, document


def filament(path: Path) -> dict[int, float]:
    """Return what each tool gives, mm, by E words alone: for files that count from move to move."""
    tool, given = 0, dict[int, float]()
    for line in path.read_text().splitlines():
        words = line.split(";")[0].split()
        if words and words[0][0] == "T":
            tool = int(words[0][1:])
        for word in words[1:]:
            if word[0] == "E" and words[0] in ("G0", "G1"):
                given[tool] = given.get(tool, 0.0) + float(word[1:])
    return {tool: round(mm, 6) for tool, mm in given.items()}


@pytest.fixture(scope="module")
def tools(tmp_path_factory):
    """A print of two tools, written back in another order of each tool's contours."""
    folder = tmp_path_factory.mktemp("tools")
    source, out = folder / "in.gcode", folder / "out.gcode"
    source.write_text(made_tools_gcode())
    job, document = read_gcode(source)
    c = job.contours
    first = np.unique(c.epoch, return_index=True)[1]
    key = np.arange(len(c))[::-1].copy()
    key[first] = 10**6
    written(source, out, np.lexsort((-key, c.epoch)))
    return source, out, job, document


def test_each_tool_gives_what_it_gives_in_the_source(tools):
    """Whatever the order: a first push, a restart distance, a push on the spot, a macro's debt."""
    source, out, job, document = tools
    assert filament(out) == filament(source)
    verdict = verify_written(out, job, document, load_machine(MACHINE))
    assert not {FaultKind.STATE, FaultKind.E_TOTAL, FaultKind.COMMAND} & verdict.kinds()


@pytest.mark.parametrize("mutant", TOOL_MUTANTS, ids=lambda m: m.name)
def test_spoilt_filament_is_found(tools, tmp_path, mutant):
    """Each is a way a writer of several tools can lose or misplace filament."""
    _, good, job, document = tools
    lines = good.read_text().splitlines()
    mutant.spoil(lines, np.random.default_rng(0))
    out = tmp_path / "out.gcode"
    out.write_text("\n".join(lines) + "\n")
    found = verify_written(out, job, document, load_machine(MACHINE)).kinds()
    assert {FaultKind.STATE, FaultKind.E_TOTAL, FaultKind.COMMAND} & found


def of_two_tools(first: str, behind: str, back: str = "") -> str:
    """Return a print of two loops of T0 and two of T1, with lines at the change of tools.

    `first` stands above the change, `behind` before T1's first loop, `back` behind each loop.
    """
    text = HEAD + "T0\n;LAYER_CHANGE\n;Z:0.2\nG1 Z0.2 F600\n"
    for k, x in enumerate((20, 60, 100, 140)):
        if k == 2:
            text += f"{first}T1\n"
        elif k:
            text += "G1 E-0.8 F2400\n"
        text += f"G1 X{x} Y20 F9000\n" + (behind if k == 2 else "G1 E0.8 F2400\n" if k else "")
        text += f"G1 F2400\nG1 X{x + 15} Y20 E0.5\nG1 Y35 E0.5\nG1 X{x} E0.5\nG1 Y20 E0.5\n{back}"
    return text + "M104 S0\n"


CHANGES = {
    "pushed by a tool for the first time": ("G1 E-2 F2400\n", "G1 E2 F2400\n"),
    "more is pushed than was pulled": ("G1 E-2 F2400\n", "G1 E2.5 F2400\n"),
    "a macro pushes back": ('G1 E-5 F2400\nM98 P"prime.g"\n', ""),
    "a macro pulls": ('M98 P"free.g"\n', "G1 E5 F2400\n"),
    "in several moves": ("G1 E-1 F2400\nG1 E-0.5 F1200\n", "G1 E0.9 F2400\nG1 E0.6 F300\n"),
    "while it wipes": ("G1 X62 E-1.2 F2400\nG1 E-0.8\n", "G1 E2 F2400\n"),
    "filament is changed": ("G1 E-3 F2400\nM600\nG1 E1 F2400\n", ""),
    "purged beside the print": ("G1 E-2 F2400\nG1 X5 Y5 F9000\nG1 E20 F200\n", "G1 E1 F2400\n"),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("relative", [True, False], ids=["M83", "M82"])
def test_changes_of_tools_lose_nothing(tmp_path, change, relative):
    """E is counted by tool: what one pulls is not what another pushes."""
    text = of_two_tools(*CHANGES[change])
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(text if relative else absolute(text))
    job, document = written(source, out, [1, 0, 2, 3])
    assert totals(out) == pytest.approx(totals(source), abs=1e-6)
    found = verify_written(out, job, document, load_machine(MACHINE)).faults
    assert [str(f) for f in found if f.kind in (FaultKind.STATE, FaultKind.E_TOTAL)] == []


def absolute(text: str) -> str:
    """Return lines that count E from move to move as lines that count from the begin, M82."""
    e, lines = 0.0, []
    for line in text.replace("M83", "M82").splitlines():
        words = line.split()
        for k, word in enumerate(words[1:], 1):
            if word[0] == "E" and words[0] == "G1":
                e += float(word[1:])
                words[k] = f"E{e:.5f}"
        lines.append(" ".join(words))
        if line.startswith("T1"):
            lines.append("G92 E0")
            e = 0.0
    return "\n".join(lines) + "\n"


def totals(path: Path) -> list[float]:
    motions = read_motions(path)
    return np.bincount(motions.tool, motions.extrusion, 2).tolist()


def test_a_tool_retracts_as_itself(tmp_path):
    """Length and feed of one tool would starve, or string, the beads of another."""
    text = HEAD
    for layer in range(3):
        text += f";LAYER_CHANGE\n;Z:{0.2 * (layer + 1):.1f}\nG1 Z{0.2 * (layer + 1):.1f} F600\n"
        for tool, pull, feed in ((0, 0.8, 2400), (1, 3.0, 1200)):
            text += f"T{tool}\n"
            for k in range(4):
                x, y = 20 + 60 * tool + 25 * (k % 2), 20 + 40 * (k // 2)
                text += f"G1 X{x} Y{y} F9000\n"
                text += f"G1 E{pull} F{feed}\n" if layer or k else ""
                text += f"G1 F2400\nG1 X{x + 15} Y{y} E0.5\nG1 Y{y + 15} E0.5\nG1 X{x} E0.5\n"
                text += f"G1 E-{pull} F{feed}\n"
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(text + "M104 S0\n")
    job, document = read_gcode(source)
    assert [(s.retract_mm, s.retract_feed) for s in map(job.settings.for_tool, (0, 1))] == [
        (0.8, 40.0), (3.0, 20.0)
    ]  # fmt: skip
    c = job.contours
    order = np.lexsort((np.where(np.diff(c.epoch, prepend=-1) != 0, -1, -np.arange(24)), c.epoch))
    written(source, out, order)
    assert FaultKind.STATE not in verify_written(out, job, document, load_machine("paper")).kinds()
    motions = read_motions(out)
    pulled = motions.extrusion < 0.0
    for tool, length, feed in ((0, -0.8, 40.0), (1, -3.0, 20.0)):
        own = pulled & (motions.tool == tool)
        assert np.allclose(motions.extrusion[own], length)
        assert np.allclose(motions.feed[own], feed)


def test_a_tool_without_a_retraction_gets_none(tmp_path):
    """Nowhere more is pulled than the source does with that tool: the other's is not its own."""
    text = of_two_tools("", "").replace("T1\n", "T1\n;no retraction\n")
    head, tail = text.split(";no retraction\n")
    source = tmp_path / "in.gcode"
    source.write_text(head + tail.replace("G1 E-0.8 F2400\n", "").replace("G1 E0.8 F2400\n", ""))
    settings = read_gcode(source)[0].settings
    assert [settings.for_tool(tool).retract_mm for tool in (0, 1)] == [0.8, 0.0]


def test_a_file_that_is_its_source_is_not_compared_with_a_writers_lines(tmp_path):
    """`plan` leaves what cannot be made faster, whatever commands it has."""
    path = tmp_path / "in.gcode"
    path.write_text(of_two_tools("G1 E-2 F2400\n", "G1 E2 F2400\n").replace("G1 X", "G0 X"))
    assert verify(path, path, MACHINE, seed=0, trials=1).ok


@pytest.mark.slow
@pytest.mark.parametrize("kind", [pytest.param("one tool", marks=pytest.mark.long), "two tools"])
def test_the_judge_of_drafts_is_the_judge_of_files(tmp_path, kind):
    """What is written has passed all that `verify --source` asks: both find a mutant, or none."""
    two = kind == "two tools"
    source, good = tmp_path / "in.gcode", tmp_path / "good.gcode"
    source.write_text(made_tools_gcode() if two else made_gcode([(60.0, 100.0), (200.0, 100.0)]))
    job, document = written(source, good)
    machine = load_machine(MACHINE)
    out, seen = tmp_path / "out.gcode", 0
    for mutant in (*GCODE_MUTANTS, *(TOOL_MUTANTS if two else ())):
        lines = good.read_text().splitlines()
        try:
            mutant.spoil(lines, np.random.default_rng(0))
        except NotHereError:
            continue
        out.write_text("\n".join(lines) + "\n")
        draft = verify_written(out, job, document, machine, seams=[])
        file = judged(out, source)
        assert (file is None or bool(file)) == (not draft.ok), mutant.name
        seen += 1
    assert seen > 60


def judged(out: Path, source: Path) -> set[str] | None:
    """Return what `verify --source` finds; None where it refuses the file."""
    try:
        return {str(fault) for fault in verify(out, source, MACHINE, seed=0, trials=1).faults}
    except InputError:
        return None


def test_what_rounding_leaves_is_no_bead(tmp_path):
    """A hundredth of a micrometre pushed behind a bead would read as its last segment."""
    text = HEAD + "T0\n;LAYER_CHANGE\n;Z:0.2\nG1 Z0.2 F600\n"
    for k, x in enumerate((20, 40, 56, 100)):
        text += "G1 E-0.8 F2400\n" if k else ""
        text += "M104 S210\n" if k == 3 else ""
        text += f"G1 X{x} Y20 F9000\n" + ("G1 E0.80001 F2400\n" if k else "")
        text += f"G1 F2400\nG1 X{x + 15} Y20 E0.5\nG1 Y35 E0.5\n"
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(text + "M104 S0\n")
    turned = np.array([False, False, True, False])
    job, document = written(source, out, [0, 2, 1, 3], turned)
    assert len(read_gcode(out)[0].contours.points) == len(job.contours.points)
    assert filament(out) == filament(source)
    kinds = verify_written(out, job, document, load_machine("paper")).kinds()
    assert not {FaultKind.STATE, FaultKind.E_TOTAL} & kinds


def test_a_travel_with_hardly_anything_retracted_is_a_fault(tmp_path: Path) -> None:
    """A fiftieth was pulled before the travel and the rest behind it: it counted as retracted."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(made_gcode([(100.0, 100.0), (150.0, 100.0)]))
    job, document = written(source, out)
    lines = out.read_text().splitlines()
    rows = range(len(lines) - 2)
    k = next(k for k in rows if lines[k].startswith("G1 E-0.8") and lines[k + 1].startswith("G1 X"))
    before = ["G1 E-0.01600 F2100"], ["G1 E-0.78400 F2100"]
    for pulls in ([], [" E-0.00001"]):
        travel = lines[k + 1].replace(" F", "".join(pulls) + " F", 1)
        made = [*lines[:k], *before[0], travel, *before[1], *lines[k + 2 :]]
        out.write_text("\n".join(made) + "\n")
        faults = verify_written(out, job, document, load_machine(MACHINE)).faults
        assert any("mm unretracted" in fault.text for fault in faults)


def test_the_ways_behind_the_start_code_and_above_the_end_code_are_judged(tmp_path: Path) -> None:
    """Primed where the start code ends, or retracted where the end code begins, it passed."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_text(made_gcode([(100.0, 100.0), (150.0, 100.0)]))
    job, document = read_gcode(source)
    last = len(job.contours) - 1
    order = np.arange(last + 1)
    order[last - 4 :] = [last - 2, last - 1, last, last - 4, last - 3]  # ends far from the source's
    written(source, out, order)
    machine = load_machine(MACHINE)
    lines, sound = out.read_text().splitlines(), verify_written(out, job, document, machine)
    assert not any("mm unretracted" in fault.text for fault in sound.faults)
    beads = [k for k, line in enumerate(lines) if re.match("G[1-3] X.* E", line)]
    push = next(k for k, line in enumerate(lines) if line.startswith("G1 E0.8"))
    pull = next(k for k in range(beads[-1], len(lines)) if lines[k].startswith("G1 E-0.8"))
    across = [k for k, line in enumerate(lines) if re.match(r"G1 X(?!.* E)", line)]
    above = next(k for k in across if k < push)
    behind = next(k for k in across if k > pull)
    for taken, put in ((push, above), (pull, behind)):
        made = [*lines]
        made.insert(put, made.pop(taken))
        out.write_text("\n".join(made) + "\n")
        faults = verify_written(out, job, document, machine).faults
        assert any("mm unretracted" in fault.text for fault in faults)


def test_a_source_that_travels_primed_to_its_first_bead_may(tmp_path: Path) -> None:
    """What it does by itself is no fault of what is made of it, nor its own."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    text = made_gcode([(100.0, 100.0), (150.0, 100.0)])
    text = text.replace("G1 E-0.80000 F2100\nM107\n", "M107\n", 1)
    source.write_text(text.replace("G1 E0.80000 F2100\n", "", 1))
    job, document = written(source, out)
    for path in (source, out):
        faults = verify_written(path, job, document, load_machine(MACHINE)).faults
        assert not any("mm unretracted" in fault.text for fault in faults)
