"""Slicing meshes: find a slicer and run it in a temporary folder."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import weakref
from collections.abc import Sequence, Set
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from decmcts.arguments import check_fields, checked
from decmcts.errors import InputError
from decmcts.formats.files.atomic import draft_folder
from decmcts.formats.mesh import SliceOptions
from decmcts.formats.mesh.slicers import (
    CURA_DEFINITION,
    PROGRAMS,
    Request,
    Slicer,
    command_for,
    config_paths,
    slicer_of,
)
from decmcts.print.machine import Machine

AUTO = "auto"
TIMEOUT_S = 1800.0
TAIL_BYTES = 20_000  # of what a slicer printed, enough to find why it failed
CURA_SHARED = ("/usr/share/cura", "/usr/local/share/cura")


@dataclass(frozen=True, slots=True)
class Chosen:
    """The slicer to use."""

    slicer: Slicer
    program: Path
    config: tuple[Path, ...] = ()


@checked
def choose_slicer(name: str = AUTO, config: str | None = None) -> Chosen:
    """Return the slicer that `--slicer` means.

    `auto` is the first on the PATH that can run with what is given.

    Raises
    ------
    InputError
        For an unknown name, a program that is not there, or a missing configuration.
    """
    given = config_paths(config)
    if name != AUTO:
        return _named(name, given)
    for slicer in Slicer:
        if chosen := usable(slicer, given):
            return chosen
    if given:
        raise InputError(
            "no slicer this configuration is for is on the PATH", path=given[0],
            advice=f"install one ({', '.join(Slicer)}), or name it with --slicer",
        )  # fmt: skip
    raise InputError(
        "no slicer is found, and a mesh needs one",
        advice="install PrusaSlicer, name a slicer with `plan --slicer`, or slice the mesh yourself"
        " and give its G-code",
    )


def usable(
    slicer: Slicer, config: tuple[Path, ...], *, cura_shared: Sequence[str] = CURA_SHARED
) -> Chosen | None:
    """Return a slicer that is on the PATH and has the kind of configuration it needs.

    Cura's own is looked for in the folders `cura_shared` where none is given.
    """
    program = _on_path(slicer)
    if program is None:
        return None
    ends = {path.suffix.lower() for path in config}
    if slicer == Slicer.PRUSA:
        return Chosen(slicer, program, config) if ends <= {".ini"} else None
    if slicer == Slicer.ORCA:
        several = len(config) > 1 and ends == {".json"}
        return Chosen(slicer, program, config) if several else None
    config = config or cura_definition(cura_shared)
    return Chosen(slicer, program, config) if len(config) == 1 and ends <= {".json"} else None


def _named(name: str, config: tuple[Path, ...]) -> Chosen:
    """Return the slicer of a name, or the program at a path."""
    if name.lower() in tuple(Slicer):
        slicer = Slicer(name.lower())
        program = _on_path(slicer)
        if program is None:
            raise InputError(
                f"{slicer} is not on the PATH as {', '.join(PROGRAMS[slicer])}",
                advice="give the path of its program with --slicer",
            )
    else:
        where = shutil.which(name)
        if where is None:
            raise InputError(
                f"'{name}' is no slicer and no program",
                advice=f"--slicer takes auto, {', '.join(Slicer)} or a path",
            )
        program = Path(where).absolute()
        known = slicer_of(program) or slicer_of(program.resolve())
        if known is None:
            raise InputError(
                f"this program's name does not tell which of {', '.join(Slicer)} it is",
                path=program,
                advice="make a link to it whose name begins with the slicer's",
            )
        slicer = known
    if slicer == Slicer.CURA:
        config = config or cura_definition()
    return Chosen(slicer, program, config)


def _on_path(slicer: Slicer) -> Path | None:
    found = (shutil.which(name) for name in PROGRAMS[slicer])
    return next((Path(where).absolute() for where in found if where), None)


def cura_definition(shared: Sequence[str] = CURA_SHARED) -> tuple[Path, ...]:
    """Return Cura's base definition where a package of Cura is installed, else nothing."""
    places = (Path(folder) / CURA_DEFINITION for folder in shared)
    return next(((place,) for place in places if place.is_file()), ())


class SlicedFolder:
    """A temporary folder that is deleted with this object."""

    def __init__(self) -> None:
        stack = ExitStack()
        self.path = stack.enter_context(draft_folder())
        weakref.finalize(self, stack.close)


@dataclass(frozen=True, slots=True)
class Slicing:
    """How meshes are sliced.

    Parameters
    ----------
    chosen : Chosen | None
        The slicer; `choose_slicer` finds one. None: the first that is found.
    options : SliceOptions
        Its settings; the bed is that of the machine.
    given : Set[str]
        Names of the options that a slicer with a configuration file is told too. One without
        is told all.

    Examples
    --------
    >>> from decmcts import Slicing
    >>> Slicing().options.layer_height
    0.2
    """

    chosen: Chosen | None = None
    options: SliceOptions = field(default_factory=SliceOptions)
    given: Set[str] = frozenset()

    def __post_init__(self) -> None:
        check_fields(self)

    def slice_with(self, chosen: Chosen, mesh: Path, machine: Machine, folder: Path) -> Path:
        """Slice a mesh for a machine and return the G-code file, in a folder."""
        options, source = self.options.for_machine(machine), mesh
        if chosen.slicer == Slicer.CURA:  # it cannot put a mesh on a bed
            from decmcts.formats.mesh.load import load_solid  # slow to import, and seldom needed

            source = folder / "placed.stl"
            load_solid(mesh, options.bed).export(source)
        request = Request(
            chosen.program, source.resolve(), folder, options, self.given, chosen.config
        )
        command = command_for(chosen.slicer, request)
        for path, text in command.files:
            path.write_text(text, encoding="utf-8")
        run_slicer(command.words, folder, mesh)
        if not command.output.is_file() or not command.output.stat().st_size:
            _fail(chosen.program, "wrote no G-code", folder, mesh)
        return command.output


def run_slicer(
    words: tuple[str, ...], folder: Path, mesh: Path, *, timeout_s: float = TIMEOUT_S
) -> None:
    """Run a slicer in a folder until it ends; none of its processes is left running.

    Raises InputError when it cannot start, fails, or takes longer than `timeout_s`.
    """
    program = Path(words[0])
    with (folder / "said.txt").open("wb") as output:
        try:  # in a session of its own, so that all it starts can be ended
            process = subprocess.Popen(
                words, cwd=folder, stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise InputError(f"cannot be started ({error.strerror})", path=program) from error
        try:
            code = process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            _fail(program, f"was not done after {timeout_s:g} s", folder, mesh)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
    if code != 0:
        how = f"was ended by signal {-code}" if code < 0 else f"failed with code {code}"
        _fail(program, how, folder, mesh)


def _fail(program: Path, what: str, folder: Path, mesh: Path) -> NoReturn:
    """Raise InputError with the most likely reason among what the slicer printed."""
    output = folder / "said.txt"
    text = output.read_bytes()[-TAIL_BYTES:].decode("utf-8", "replace") if output.exists() else ""
    reason = why(text)
    raise InputError(
        f"{program.name} {what}" + (f": {reason}" if reason else ""),
        path=mesh,
        advice="try it in the slicer itself, and give the G-code",
    )


def why(output: str) -> str:
    r"""Return the line of a slicer's output that most likely names the cause.

    Examples
    --------
    >>> why("10 => Processing\nerror: objects do not fit\nsee the manual")
    'error: objects do not fit'
    """
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    blamed = [x for x in lines if "error" in x.lower() or "could not" in x.lower()]
    return (blamed or lines or [""])[-1][:300]
