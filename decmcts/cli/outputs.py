"""Writes what was asked for, only after verification, each file atomically."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from decmcts import __version__
from decmcts.cli.console import clock_time, summary_of
from decmcts.cli.pipeline import Planned
from decmcts.cli.quality import cooling_line
from decmcts.errors import InputError, VerificationError
from decmcts.formats.atomic import refuse_special, write_whole
from decmcts.formats.drafts import draft_folder
from decmcts.formats.gcode import write_gcode, write_head_gcode
from decmcts.formats.gcode.binary import SUFFIX
from decmcts.formats.gcode.duration import FileTime, print_time
from decmcts.formats.gcode.progress import restated
from decmcts.formats.gcode.source_text import load_text, packed_text, save_text
from decmcts.formats.mesh import MESH_SUFFIXES
from decmcts.formats.plan_json import write_plan
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind
from decmcts.print.walls import outer_walls
from sim.content.seams import seams_of_plan
from sim.faults import Verdict
from sim.files.written import verify_written
from sim.heads.together import verify_heads

STDOUT = Path("-")  # as an output: standard output
SAME_TIME_S = 0.25, 1.0  # times of whole files that differ by less are the same, for short prints
SAME_TIME_SHARE = 1e-3  # and for long ones; between them this share. Feeds and positions are
# written anew with the source's decimals, which moves the estimate by a fraction of a second


def refuse_unwritable(
    paths: Sequence[Path | None], source: Path, *read: Path, edits: bool = False
) -> None:
    """Fail before the long work: each output needs an existing folder we may write to.

    No output may be the input, what else is `read`, or another output. `edits`: the input
    is one `decmcts post` could edit in place.
    """
    if source == STDOUT:
        raise InputError("standard input is not read", advice="give the name of a file")
    taken: set[Path] = set()
    for path in (p for p in paths if p is not None and p != STDOUT):
        place = Path(os.path.realpath(path))
        _refuse_place(path)
        if _same(path, source):
            raise InputError(
                "the output is the input",
                path=path,
                advice="name another file"
                + (", or use `decmcts post` to edit in place" if edits else ""),
            )
        if any(_same(path, other) for other in read):
            raise InputError("the output is read too", path=path, advice="name another file")
        if place in taken:
            raise InputError("two outputs have this name", path=path, advice="name another file")
        taken.add(place)


def _same(path: Path, other: Path) -> bool:
    return path.exists() and other.exists() and path.samefile(other)


def _refuse_place(path: Path) -> None:
    """Raise InputError where no file can be written under this name."""
    folder = Path(os.path.realpath(path)).parent
    if not folder.is_dir():
        raise InputError("no such folder", path=folder, advice="make it, or name another output")
    if path.is_dir():
        raise InputError("the output is a folder", path=path, advice="name a file")
    refuse_special(path)
    if not os.access(folder, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise InputError("cannot write here", path=path, advice="name another output")


def refuse_two_on_stdout(output: Path | None, *, as_json: bool) -> None:
    """Raise InputError where result and summary both want standard output."""
    if output == STDOUT and as_json:
        raise InputError(
            "-o - and --json both want standard output", advice="name a file with -o FILE"
        )


def name_of(path: Path) -> str:
    """Return an output's name as people know it."""
    return "standard output" if path == STDOUT else str(path)


def put(content: bytes, path: Path, *, packed: bool = False) -> None:
    """Write a result to its file, whole or not at all, or to standard output (`-`).

    Unless it is `packed` already it becomes what the file's name says.

    Raises
    ------
    InputError
        When it cannot be written.
    """
    if path != STDOUT:
        if packed:
            write_whole(path, content)
        else:
            save_text(content, path)
        return
    try:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is closed"
        raise InputError(f"standard output cannot be written ({reason})") from error


def refuse_unpackable(output: Path | None, source: Path) -> None:
    """Raise InputError for a .bgcode that what is read cannot be made into."""
    if output is None or output.suffix.lower() != SUFFIX:
        return
    if source.suffix.lower() in MESH_SUFFIXES:
        raise InputError(
            "what is made of a mesh is not written as .bgcode",
            path=output,
            advice="name a .gcode file",
        )
    packed_text(load_text(source), output, source)


def refuse_other_suffixes(plan: Path | None, report: Path | None, picture: Path | None) -> None:
    """Raise InputError for an output whose name says it is of another kind."""
    known = ((plan, (".json", ".json.gz")), (report, (".html", ".htm")), (picture, (".png",)))
    for path, ends in known:
        if path is not None and not path.name.lower().endswith(ends):
            raise InputError(
                f"the name of this output must end in {' or '.join(ends)}",
                path=path,
                advice="rename it",
            )


def bare(metrics: dict[str, Any]) -> float:
    """Return the paper's metric out of a plan's metrics."""
    return float(metrics["extrusionless_travel_mm"])


def header_lines(planned: Planned) -> list[str]:
    """Return the comment lines that say what was done to the file."""
    was, now = planned.before.metrics, planned.after.metrics
    machine = planned.after.machine
    seam = f" ({now['seam']})" if "seam" in now else ""
    return [
        f"reordered by decmcts {__version__} for machine {machine.name}",
        f"planner {now['planner']} for {now.get('objective', 'makespan')},"
        f" freedom {now['freedom']}{seam}, seed {now['seed']}",
        f"extrusionless travel {bare(was):.1f} mm -> {bare(now):.1f} mm",
        f"estimated print time {was['print_time_s']:.0f} s -> {now['print_time_s']:.0f} s",
        *(line for line in (cooling_line(planned.after), layers_line(planned)) if line),
        "verified: every extrusion exactly once, no contact of head and print",
    ]


def layers_line(planned: Planned) -> str | None:
    """Return one line on layers entered more often than in the source; None if they are not."""
    lanes, layer = planned.after.plan.heads, planned.loaded.job.contours.layer
    if len(lanes) > 1 or not len(layer):
        return None
    order = lanes[0].contour[lanes[0].kind == ActionKind.PRINT]
    was, now = (1 + int(np.count_nonzero(np.diff(row))) for row in (layer, layer[order]))
    if now <= was:
        return None
    return (
        f"layers are entered {now} times instead of {was}: viewers count every change of height "
        "as a layer, so their sliders follow the sequence"
    )


@dataclass(frozen=True, slots=True)
class FileTimes:
    """Estimated print times of whole files, start and end G-code included, in seconds."""

    before_s: float | None  # of the source; None: it is no G-code
    after_s: float
    refused_s: float | None = None  # of the new order, where the source was kept instead
    before: Mapping[str, Any] = field(default_factory=dict)  # what else whole files show:
    after: Mapping[str, Any] = field(default_factory=dict)  # see `whole_file`

    @property
    def longer(self) -> bool:
        """Whether the result takes longer than its source."""
        return self.before_s is not None and is_longer(self.before_s, self.after_s)

    @property
    def kept(self) -> bool:
        """Whether the result is the source as it was."""
        return self.refused_s is not None


def is_longer(before_s: float, after_s: float) -> bool:
    """Say whether a time is longer than another by more than writing a file anew may do."""
    least, most = SAME_TIME_S
    return after_s > before_s + min(max(least, SAME_TIME_SHARE * before_s), most)


def file_time_line(
    before_s: float, after_s: float, retracted_mm: float | None, *, combs: bool = False
) -> str:
    """Return one line on the time of the whole file, and on why it may have grown if it did.

    `retracted_mm` is the travel from which filament is retracted, None if it never is;
    `combs` says that longer ones inside the part are left bare, as in the source.
    Some slicers lift while they travel.
    """
    line = f"print time of the whole file: {clock_time(before_s)} → {clock_time(after_s)}"
    if not is_longer(before_s, after_s):
        return line
    kind = "travel that leaves the part" if combs else "travel"
    habit = (
        "" if retracted_mm is None else f"every {kind} from {retracted_mm:g} mm up is retracted, "
    )
    return (
        f"{line}, longer: here {habit}lifts go straight up and what must cool is waited for, which "
        "the source may do less; where time is what counts, print the source"
    )


def whole_file_line(planned: Planned, times: FileTimes | None) -> str | None:
    """Return the line on the time of a result's whole file; None where there is no other."""
    if times is None or times.before_s is None:
        return None
    settings = planned.loaded.job.settings
    retracts = settings.firmware_retraction or settings.retract_mm > 0.0
    retracted_mm = settings.retract_min_travel_mm if retracts else None
    combs = settings.bare_inside_mm > 0.0
    return file_time_line(times.before_s, times.after_s, retracted_mm, combs=combs)


def draft_single(planned: Planned, draft: Path, path: Path) -> FileTimes:
    """Write the reordered G-code of a one-head plan to a draft and read it back.

    Raises
    ------
    VerificationError
        When the text differs from the verified plan; it names `path`, where it was to go.
    """
    loaded, lane = planned.loaded, planned.after.plan.heads[0]
    write_gcode(loaded.document, loaded.job, lane, draft, header_lines=header_lines(planned))
    times = _file_times(planned, draft)
    if times.before_s:
        draft.write_bytes(restated(draft.read_bytes(), times.after_s / times.before_s))
    seams = list(seams_of_plan(lane))
    verdict = verify_written(
        draft, loaded.job, loaded.document, loaded.machine, seams=seams, lane=lane
    )
    require_sound(verdict, path)
    return times


def compared_with(planned: Planned) -> Path | None:
    """Return the G-code a result is compared with; None where there is none."""
    source = Path(planned.loaded.document.path)  # of a mesh: what its slicer made
    return None if source.suffix.lower() in MESH_SUFFIXES else source


def _file_times(planned: Planned, draft: Path) -> FileTimes:
    """Estimate what the source takes and what was made of it takes."""
    source, limits = compared_with(planned), planned.loaded.machine.limits
    walls, own = outer_walls(planned.loaded.job.contours), planned.loaded.own_limits
    after = print_time(draft, limits, own_limits=own, walls=walls)
    if source is None:
        return FileTimes(None, after.total_s, after=whole_file(after))
    before = print_time(source, limits, own_limits=own, walls=walls)
    return FileTimes(
        before.total_s, after.total_s, before=whole_file(before), after=whole_file(after)
    )


def whole_file(time: FileTime) -> dict[str, Any]:
    """Return what a whole file shows as metrics, for tables, `--json` and plan.json."""
    return {
        "file_time_s": time.total_s,
        "retractions": time.retractions,
        "travel_over_walls_mm": time.over_walls_mm,
    }


def with_whole_files(planned: Planned, times: FileTimes) -> Planned:
    """Return a result with the figures of its whole files among its metrics."""
    before = replace(planned.before, metrics={**planned.before.metrics, **times.before})
    after = replace(planned.after, metrics={**planned.after.metrics, **times.after})
    return replace(planned, before=before, after=after)


def require_sound(verdict: Verdict, path: Path) -> None:
    """Raise VerificationError if a text that was to be written to `path` has faults."""
    if not verdict.ok:
        raise VerificationError(
            f"{path} was not written: its G-code failed verification with "
            f"{len(verdict.faults)} faults: {verdict.shown}"
        )


def stem_of(output: Path) -> Path:
    """Return what the names of the heads' files begin with: the output, without `.gcode`.

    Raises
    ------
    InputError
        For standard output and for folders.
    """
    if output == STDOUT:
        raise InputError(
            "several files do not go to standard output", advice="name a stem, such as -o part"
        )
    if not output.name or output.is_dir():
        raise InputError("the output is a folder", path=output, advice="name a stem in it")
    return output.with_suffix("") if output.suffix.lower() == ".gcode" else output


def head_files(stem: Path, machine: Machine) -> list[Path]:
    """Return the names of the files of the machine's heads, `STEM_HEAD.gcode`."""
    return [stem.with_name(f"{stem.name}_{head.name}.gcode") for head in machine.heads]


def write_heads(planned: Planned, stem: Path) -> list[Path]:
    """Write one G-code file per head, `STEM_HEAD.gcode`; returns the paths.

    Raises
    ------
    VerificationError
        When the files, read back, are not the verified plan; then none is written.
    """
    loaded, plan = planned.loaded, planned.after.plan
    parks = {head.name: head.park for head in loaded.machine.heads}
    at = [parks[lane.head] for lane in plan.heads]
    names = [f"{stem.name}_{lane.head}.gcode" for lane in plan.heads]
    with draft_folder() as folder:
        drafts = [folder / name for name in names]
        for index, draft in enumerate(drafts):
            write_head_gcode(
                loaded.document,
                loaded.job,
                plan,
                index,
                draft,
                header_lines=header_lines(planned),
                park=at[index],
                release=loaded.machine.release,
            )
        verdict = verify_heads(
            drafts, plan, loaded.job, loaded.document, parks=at, release=loaded.machine.release
        )
        require_sound(verdict, stem)
        for name, draft in zip(names, drafts, strict=True):
            put(draft.read_bytes(), stem.with_name(name))
    return [stem.with_name(name) for name in names]


def write_extras(
    planned: Planned, *, plan: Path | None, report: Path | None, picture: Path | None
) -> list[Path]:
    """Write plan.json, report and picture where asked; returns what was written."""
    written: list[Path] = []
    if plan is not None:
        write_plan(planned.after, plan)
        written.append(plan)
    if report is not None:
        from sim.pictures.report import write_report  # plotly loads for those who ask

        write_report(report, before=planned.before, after=planned.after, history=planned.history)
        written.append(report)
    if picture is not None:
        from sim.pictures.drawings import draw_plan  # and so does matplotlib

        draw_plan(picture, planned.before, planned.after)
        written.append(picture)
    return written


def figures(
    planned: Planned, paths: Sequence[Path], times: FileTimes | None = None
) -> dict[str, Any]:
    """Return what `--json` prints of a result that was written to `paths`."""
    loaded = planned.loaded
    return {
        "input": str(loaded.path),
        "machine": loaded.machine.name,
        "slicer": loaded.job.slicer,
        "sliced_by": loaded.sliced_by or None,
        "edges": loaded.graph.n_edges,
        "barriers": [f"{b.text} (line {b.line}): {b.reason}" for b in loaded.job.barriers],
        "notes": list(loaded.job.notes),
        "seconds": {name: round(value, 3) for name, value in planned.seconds.items()},
        "before": planned.before.metrics,
        "after": planned.after.metrics,
        "gain": summary_of(planned.before.metrics, planned.after.metrics),
        "file_time_s": {"before": times.before_s, "after": times.after_s} if times else None,
        "kept_source": times is not None and times.kept,
        "verified": True,
        "written": [str(path) for path in paths],
    }
