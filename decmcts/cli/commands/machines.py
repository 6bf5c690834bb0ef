"""`decmcts machines`: those that come with the program, or one of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from decmcts.cli import options as opt
from decmcts.cli.console import out, print_json
from decmcts.errors import InputError
from decmcts.formats.files.names import as_file_name
from decmcts.formats.machines.machine_file import load_machine, preset_names
from decmcts.print.machine import Machine


@opt.app.command()
def machines(
    draw: Annotated[
        Path | None,
        opt.output(
            "--draw FOLDER",
            "Folder for a PNG of every machine listed; or, with --machine, a .png or .svg",
        ),
    ] = None,
    machine: opt.ListedMachineOption = None,
    as_json: opt.JsonOption = False,
) -> None:
    """List the machines; with --draw, draw their heads, and several as near as they may be."""
    is_file = draw is not None and draw.suffix.lower() in (".png", ".svg") and not draw.is_dir()
    if is_file and machine is None:
        raise InputError(
            "a picture is of one machine", path=draw, advice="add --machine NAME, or name a folder"
        )
    folder = draw.parent if draw is not None and is_file else draw
    if folder is not None and not folder.is_dir():
        raise InputError("no such folder", path=folder, advice="make it first")
    listed = [load_machine(name) for name in (preset_names() if machine is None else [machine])]
    if draw is not None:
        from sim.pictures.machine_picture import draw_machine  # takes a second to load

        for m in listed:
            draw_machine(m, draw if is_file else draw / f"{as_file_name(m.name)}.png")
    if as_json:
        print_json("decmcts-machines/1", {"machines": [facts(m) for m in listed]})
        return
    for m in listed:
        show_machine(m)
    if draw is not None:
        out.show(f"wrote {draw}" if is_file else f"wrote a PNG a machine to {draw}")


def show_machine(m: Machine) -> None:
    """Print a machine in a few lines."""
    from rich.padding import Padding

    bed = f"{m.bed_max[0] - m.bed_min[0]:g}×{m.bed_max[1] - m.bed_min[1]:g} mm"
    slices = ", ".join(f"{part.height_mm:g}" for part in m.heads[0].slices)
    heads = " ".join(head.name for head in m.heads)
    out.show(f"{m.name}: bed {bed}, heads: {heads}, slices at {slices} mm")
    out.print(Padding(m.source.split(";")[0], (0, 0, 0, 4)))


def facts(m: Machine) -> dict[str, Any]:
    """Return what `--json` prints of a machine."""
    return {
        "name": m.name,
        "source": m.source,
        "bed_min": list(m.bed_min),
        "bed_max": list(m.bed_max),
        "heads": [head.name for head in m.heads],
        "slices_mm": [float(part.height_mm) for part in m.heads[0].slices],
    }
