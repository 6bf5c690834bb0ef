"""Files of several heads judged together against the plan they were made from.

Each file is read back and judged by itself (`sim.heads.one_file`). The sync points of all files
together must order what the plan orders (`sim.heads.order`), so a single file proves nothing.

The words of the files must do what the files count on. Known of controllers are a few things that
make a signal come early, or never; each is looked for in the text (docs/gcode.md has the lines of
their sources).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode import GcodeDocument
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine, Release, SyncWords
from decmcts.print.plan import JointPlan
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.files.commands import check_heads_book
from sim.files.settings import TravelSettings, settings_of, travelling
from sim.files.written import source_text, travels_of
from sim.heads.changes import check_hot_ends
from sim.heads.file import HeadFile, read_head_file
from sim.heads.ledger import check_filament
from sim.heads.one_file import Walked, walk_file
from sim.heads.order import Intervals, check_order, check_sync
from sim.heads.sync import Knowledge


def verify_heads(
    machine: Machine, paths: Sequence[Path | str | HeadFile], plan: JointPlan, job: PrintJob,
    document: GcodeDocument, *, read: bool = False,
) -> Verdict:  # fmt: skip
    """Check the files of all heads of a plan, in the plan's order of heads.

    They may be read already. `job` and `document` are the source the plan was made from; with
    `read` the plan was read from these files (`sim.heads.plan`).
    """
    try:
        files = [
            one if isinstance(one, HeadFile) else read_head_file(one, machine.words)
            for one in paths
        ]
    except InputError as error:
        return unreadable(error)
    if faults := check_names(files, plan):
        return Verdict(tuple(faults))
    walked = [
        walk_file(file, h, plan, job, document, machine, read=read) for h, file in enumerate(files)
    ]
    return judge_together(walked, plan, job, document, machine, read=read)


def unreadable(error: InputError) -> Verdict:
    """Return the verdict on files of which one cannot be read."""
    return Verdict((Fault(FaultKind.STATE, f"a file cannot be read back: {error}"),))


def judge_together(
    walked: Sequence[Walked], plan: JointPlan, job: PrintJob, document: GcodeDocument,
    machine: Machine, *, read: bool = False,
) -> Verdict:  # fmt: skip
    """Check what the files of all heads do together; of each the faults found so far come first."""
    files = [each.file for each in walked]
    if named := check_names(files, plan):
        return Verdict(tuple(named))
    faults = [fault for each in walked for fault in each.faults]
    complete = all(each.walk.complete for each in walked)
    if complete:
        faults += check_filament(walked, job, document)
    source = source_text(document)
    faults += check_heads_book([file.lines.text for file in files], source)
    faults += _check_travels(walked, source, document)
    if document.own_starts and complete:
        laid = [(each.file, each.walk.laid) for each in walked]
        faults += check_hot_ends(laid, source, job, document)
    known, release = Knowledge([file.syncs for file in files]), machine.release
    faults += check_words(machine.words, release) + check_sync(files, known, release)
    intervals = Intervals(files, machine.signal_interval_s if release == "point" else 0.0)
    faults += intervals.check()
    if complete and not known.stuck:
        faults += check_order(walked, plan, known, intervals, read=read)
    signals = sum(len(file.syncs) for file in files)
    return Verdict(tuple(faults), {"files": float(len(files)), "signals": float(signals)})


def _check_travels(walked: Sequence[Walked], source: bytes, document: GcodeDocument) -> list[Fault]:
    """Check that all heads travel under limits under which the source travels.

    But for hops within a piece, which stay under those of its beads.
    """
    travels, texts = TravelSettings.of(settings_of(source), travels_of(document.moves)), list[str]()
    for each in walked:
        motion, file = each.file.motion, each.file
        found = travelling(motion.points, motion.extrusion, motion.placed[motion.line])
        begin, end = np.array([(p.begin, p.end) for p in each.walk.laid], np.int64).reshape(-1, 2).T
        within = np.searchsorted(begin, found, "right") > np.searchsorted(end, found, "right")
        line = motion.line[found[~within]] + 1
        differing = travels.differing(settings_of(file.lines.text), line)
        texts += [f"{Path(file.path).name} {text}" for text in differing]
    return listed(FaultKind.STATE, texts)


def check_names(files: Sequence[HeadFile], plan: JointPlan) -> list[Fault]:
    """Check that there is one file for each head, and that each says so."""
    if len(files) != len(plan.heads):
        there = {file.name for file in files}
        absent = ", ".join(actions.head for actions in plan.heads if actions.head not in there)
        text = f"{len(files)} files for {len(plan.heads)} heads; name the files of all heads"
        return [Fault(FaultKind.FILE, text + (f", that of {absent} too" if absent else ""))]
    lines = []
    for k, (file, actions) in enumerate(zip(files, plan.heads, strict=True)):
        if file.name != actions.head or file.place != (k + 1, len(files)):
            places = f"head {file.name}, file {file.place[0]} of {file.place[1]}"
            lines.append(
                f"{Path(file.path).name} says it is for {places if file.name else 'no head'}, it "
                f"should be for head {actions.head}, file {k + 1} of {len(files)}"
            )
    return listed(FaultKind.COMMAND, lines)


_STOPS = re.compile(r"(M400|G0*4|M0|M1|M25|M226|M577|M598|PAUSE|TEMPERATURE_WAIT)\b", re.I)
WHEN_READ = re.compile(r"(M11[78]|M98|RESPOND|RUN_SHELL_COMMAND)\b|.*action_", re.I)
_RESUMED = re.compile(r"(M0|M1|M25|M601|PAUSE)\b", re.I)
SYSTEMS = re.compile(r"\s*(M59[678]|M606)\b", re.I)
M42 = re.compile(r"\s*M42\b(.*)", re.I)


def check_words(words: SyncWords, release: Release) -> list[Fault]:
    """Check the lines of the files themselves."""
    lines = list[str]()
    if _RESUMED.match(words.wait):
        dropped = "what resumes before the pause is dropped, so the head never goes on"
        lines.append(f"'{words.wait}': {dropped}")
    if SYSTEMS.match(words.wait):
        lines.append(f"'{words.wait}' is for motion systems of one board, files are for one each")
    if release == "point":
        lines += _of_passed(words.passed)
    return listed(FaultKind.COMMAND, lines)


def _of_passed(line: str) -> Iterator[str]:
    """Yield what keeps a line from being a signal in step with the moves."""
    if _STOPS.match(line):
        yield f"'{line}' stops the head, so it is no signal in motion"
    if WHEN_READ.match(line):
        yield f"'{line}' runs when it is read, before the moves above it have ended"
    if not {"{number}", "{count}", "{level}"} & set(re.findall(r"\{\w+\}", line)):
        yield f"'{line}' is the same for every signal, so nothing changes"
    if match := M42.match(line):
        yield from of_m42(match[1])


def of_m42(rest: str) -> Iterator[str]:
    """Yield what keeps M42 out of RepRapFirmware's queue of moves."""
    for word in rest.split():
        if not re.fullmatch(r"[PFQ]\d+|S(\d+(\.\d+)?|\{level\})", word, re.I):
            yield f"M42 with '{word}', which is no literal value, is not queued with the moves"
