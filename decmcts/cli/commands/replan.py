"""`decmcts replan`: the rest of a print that was broken off, for the heads that live."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agents.messages.event_stream import read_events
from decmcts.cli import options as opt
from decmcts.cli.commands.launch import show_joint
from decmcts.cli.commands.replay import heads_table
from decmcts.cli.console import print_json, running, steps, written
from decmcts.cli.lines import figures
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.files.atomic import write_all
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.mesh import is_mesh
from decmcts.formats.plans.plan_json import read_plan
from decmcts.planning.events import Step
from decmcts.planning.options import Limits
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.problem.source import read
from decmcts.planning.replanning.fenced import fenced_places, late_heads, other_tools, refuse_unfit
from decmcts.planning.replanning.park_files import park_paths, refuse_earlier
from decmcts.planning.replanning.replan import Rest, rest_of, search_of
from decmcts.planning.replanning.replan import replan as plan_rest
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.planning.result import Result
from decmcts.planning.writing.heads import head_files, stem_of
from decmcts.planning.writing.places import refuse_other_suffixes, refuse_unwritable
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import (
    PrintState,
    state_of_events,
    state_of_height,
    state_of_layers,
    taken_to_parks,
)

PrintWithOption = Annotated[
    list[str] | None,
    opt.basics(
        "--print-with TOOL=OTHER",
        "What a tool should print that no living head has, another prints with its "
        "filament; may be given more than once",
    ),
]
LeftOption = Annotated[
    LeftBeads,
    opt.search(
        "--left-beads", "A bead that was broken off is finished from there, or left as it is"
    ),
]


@opt.app.command()
def replan(
    plan: Annotated[Path, typer.Argument(help="PLAN.json that was carried out")],
    source: Annotated[Path, opt.basics("--source FILE", "The G-code it was made from")],
    events: Annotated[
        Path | None, opt.basics("--events FILE", "What happened until then (docs/events.md)")
    ] = None,
    layer: Annotated[
        int | None, opt.basics("--layer N", "Layers 1 to N are printed, and nothing above")
    ] = None,
    height: Annotated[
        float | None,
        opt.basics(
            "--height Z", "What ends Z mm above the bed or lower is printed, and nothing above"
        ),
    ] = None,
    fenced: Annotated[
        list[str] | None,
        opt.basics(
            "--fenced HEAD[=park|=X,Y,Z]",
            "A head that prints no more, and where it stands; may be given more than once",
        ),
    ] = None,
    parked: Annotated[
        bool,
        opt.basics(
            "--parked", "With --events: heads that live were taken to their parks since then"
        ),
    ] = False,
    slower: Annotated[
        list[str] | None,
        opt.basics(
            "--slower HEAD=FACTOR",
            "A head that takes so many times as long as planned; may be given more than once",
        ),
    ] = None,
    print_with: PrintWithOption = None,
    left_beads: LeftOption = LeftBeads.LEAVE,
    output: Annotated[
        Path | None,
        opt.basics("-o --output STEM", "Stem of the G-code files of the rest, one a head"),
    ] = None,
    plan_file: opt.PlanOption = None,
    time_limit: opt.TimeOption = 30.0,
    seed: opt.SeedOption = 0,
    as_json: opt.JsonOption = False,
) -> None:
    """Plan the rest of a print that was broken off anew, for the heads that live."""
    if output is None and plan_file is None and not as_json:
        raise InputError("nothing would be written", advice="add -o STEM, --plan FILE or both")
    if is_mesh(source):
        raise InputError("a mesh has no start code", path=source, advice="name the planned G-code")
    if parked and events is None:
        raise InputError(
            "--parked says where heads stand that events saw elsewhere, and no events are given",
            advice="add --events FILE, or leave it out",
        )
    document = read_plan(plan)
    stem = None if output is None else stem_of(output)
    heads = [] if stem is None else [*head_files(stem, document.machine), _rest_file(stem)]
    also = [plan] if events is None else [plan, events]
    refuse_unwritable([*heads, plan_file], source, *also)
    refuse_other_suffixes(plan_file, None, None)
    state = _state(document, events, layer, height)
    places = fenced_places(fenced or [], document, state, seen=events is not None)
    if parked:
        state = taken_to_parks(state)
    late = late_heads(slower or [], document.machine)
    for name in late:
        if name in places:
            raise InputError(
                f"--slower {name}: the head is fenced, and prints no more",
                advice="leave one of both away",
            )
    other = other_tools(print_with or [], document.machine, document.contours)
    refuse_unfit(other, document.machine, list(places))
    search = search_of(document, time_limit, seed)
    with running(time_limit_s=time_limit, table=heads_table) as (show, stop):
        found = read(
            source, document.machine, limits=Limits.MACHINE, report=show
        )  # fmt: skip
        rest = rest_of(document, found, state, places, left_beads, show, late, other)
        if stem is not None:
            refuse_earlier(rest.to_park, stem)
            refuse_unwritable([*heads, *park_paths(rest.to_park, stem)], source, *also)
        result = plan_rest(
            rest, search, rules_of(document), writes=stem is not None, report=show, stop=stop
        )  # fmt: skip
    paths = _write(result, rest, stem, plan_file)
    with written():
        _show(result, rest, document, source, paths, as_json=as_json)


def _state(
    document: PlanDocument, events: Path | None, layer: int | None, height: float | None
) -> PrintState:
    """Return what is printed, by events, layers or height."""
    given = sum(one is not None for one in (events, layer, height))
    if given != 1:
        raise InputError(
            "several states of the print" if given else "what is printed is not known",
            advice="give --events FILE, --layer N or --height Z, one of them",
        )
    if layer is not None:
        return state_of_layers(document, layer)
    if height is not None:
        return state_of_height(document, height)
    assert events is not None  # one of the three is given
    try:
        return state_of_events(document, read_events(events))
    except InputError as error:
        raise InputError(error.what, path=events, advice=error.advice) from error


def _rest_file(stem: Path) -> Path:
    """Return the name of the rest as one print, from which it can be judged and replanned again."""
    return stem.with_name(f"{stem.name}.gcode")


def _write(result: Result, rest: Rest, stem: Path | None, plan_file: Path | None) -> list[Path]:
    """Write what was asked for; a first Ctrl-C lets everything be written."""
    paths = list[Path]()
    with interrupt_stops(), steps() as progress:
        if stem is not None:
            progress(Step("putting the files of all heads in place"))
            first = park_paths(rest.to_park, stem)
            write_all([(path, one.text) for path, one in zip(first, rest.to_park, strict=True)])
            save_text(rest.source.path.read_bytes(), _rest_file(stem))
            paths = [*first, *result.write_gcode(stem, report=progress).paths, _rest_file(stem)]
        if plan_file is not None:
            result.write_plan(plan_file)
            paths.append(plan_file)
    return paths


def _show(
    result: Result, rest: Rest, document: PlanDocument, source: Path, paths: list[Path], *,
    as_json: bool,
) -> None:  # fmt: skip
    """Print the summary of the rest."""
    live = [head.name for head in result.planned.problem.machine.heads]
    whole, left = len(document.contours), int(rest.left.rows.sum())
    if as_json:
        state = {
            "contours": whole, "printed": rest.done, "left_out": left,
            "broken_off": len(rest.broken), "heads": live,
            "to_park": [one.head for one in rest.to_park],
            "print_with": {str(due): has for due, has in rest.print_with},
        }  # fmt: skip
        print_json("decmcts-result/1", {**figures(result, paths), "replanned": state})
        return
    what = "contours" if document.contours.of is None else "pieces of contours"
    stated = f"{whole} {what}: {rest.done} printed or begun, {left} left out; the rest is for "
    show_joint(result, f"{source.name}, {stated}{', '.join(live)}", paths)
