"""Damaged files of every format: exit code 0 or 2 within 60 s and 4 GiB, and no command lost.

`python benchmarks/fuzz.py --files 300` writes damaged files of each format, with a fresh seed
that it names, and runs the whole command on each. With `--forked` each run is a process of its own
that finds the program loaded: ten times as many fit into an hour. Seconds are of the processor,
for the machine may be busy. Messages between agents and meshes are read in such a process. The
tests read as many of each in their own process, with a fixed seed and without a search. Another
format is a row of `FORMATS`.

No command is lost: what the judge's book of commands says (`sim.files.commands`), and as often
as in the source by a reading of lines of this file's own, but for what the run says it left out.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import decmcts
from agents.launching.status import AgentStatus
from agents.messages import kinds
from agents.messages.codec import decode, encode
from decmcts.cli.commands.replay import BEGINS, cells_of, read_record
from decmcts.cli.run import run
from decmcts.errors import InputError
from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh.load import load_solid
from decmcts.formats.mesh.options import Bed
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.print.plan import PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from sim.files.commands import check_book

MOST_S, MOST_BYTES = 60, 4 * 2**30  # of the processor
WAIT_S = 600.0  # for a run that does nothing
HOSTILE = (
    b"(", b")", b"\x1b[2J", b"\x00", b"\r", b"1e5", b"-", b"9" * 40, b"nan", b"inf", b"\xff\xfe",
    b"[" * 50, b'"', b"..", b"/", b"%s", b"1e300", b"null", b"{}", b"\n" * 9, b" " * 99, b"M600 ",
)  # fmt: skip
_BRACKETS = re.compile(rb"\([^)]*+\)")
_KEPT = re.compile(rb"(?:M(?!73\b|8[23]\b|486\b)\d+|T\d+|G4|G2[89])\b[^*]*")  # stand as they are
_SETS = re.compile(rb"M(?:10[67]|20[1345]|22[01]|117|900)\b")  # as often as is needed
_FIRST = re.compile(rb"[GMT]\d+")
_SAID = re.compile(r"left out|nothing moves across|refused|temperature")


@dataclass(frozen=True)
class Format:
    """One kind of file: its name, an honest one, its reader, and the command that takes it."""

    name: str
    make: Callable[[], bytes]
    read: Callable[[Path], object]
    command: tuple[str, ...]


def damaged(raw: bytes, rng: np.random.Generator) -> bytes:
    """Return a file with one to four places changed, cut out, doubled, moved, or made hostile."""
    for _ in range(int(rng.integers(1, 5))):
        if not raw:
            return raw
        i, j = sorted(int(k) for k in rng.integers(0, len(raw) + 1, 2))
        j = min(j, i + int(rng.integers(1, 200)))
        odd = HOSTILE[int(rng.integers(len(HOSTILE)))]
        kind = int(rng.integers(7))
        raw = (
            raw[:i] + odd + raw[i:], raw[:i] + raw[j:], raw[:j] + raw[i:j] + raw[j:],
            raw[:i] + rng.bytes(j - i) + raw[j:], raw[:i], raw[:i] + odd * 50 + raw[j:],
            _number_changed(raw, i, rng),
        )[kind]  # fmt: skip
    return raw


def _number_changed(raw: bytes, at: int, rng: np.random.Generator) -> bytes:
    """Return the text with the first number behind a place replaced."""
    found = re.compile(rb"\d+").search(raw, at)
    if found is None:
        return raw
    new = (b"-1", b"0", b"1e9", b"99999", b"", b"0.5")[int(rng.integers(6))]
    return raw[: found.start()] + new + raw[found.end() :]


def checksums_mended(raw: bytes) -> bytes:
    """Return binary G-code whose blocks have right checksums, as far as they can be walked."""
    at, out = 10, raw[:10]
    while at + 12 <= len(raw):
        kind, packing = (int.from_bytes(raw[at + k : at + k + 2], "little") for k in (0, 2))
        size = int.from_bytes(raw[at + (8 if packing else 4) :][:4], "little")
        end = at + (12 if packing else 8) + (6 if kind == 5 else 2) + size
        out += raw[at:end] + zlib.crc32(raw[at:end]).to_bytes(4, "little")
        at = end + 4
    return out


def lost_commands(source: bytes, result: bytes) -> list[bytes]:
    """Return commands of a source that its result has less often, read by lines of its own."""
    due, has = (Counter(_commands(text)) for text in (source, result))
    return [c for c in due if has[c] < (1 if _SETS.match(c) else due[c])]


def _commands(text: bytes) -> list[bytes]:
    bare = (_BRACKETS.sub(b" ", row.split(b";", 1)[0]) for row in text.split(b"\n"))
    plain = (b" ".join(row.split()) for row in bare)
    return [row for row in plain if _FIRST.match(row) and _KEPT.fullmatch(row)]


def refused_or_read(kind: Format, path: Path) -> bool:
    """Read a file; True where it was read, False where it was refused in a line."""
    try:
        kind.read(path)
    except InputError:
        return False
    return True


def run_one(kind: Format, path: Path, *, forked: bool = False) -> tuple[int, str]:
    """Run the whole command on a file; returns its exit code and what is wrong, or nothing."""
    out = path.with_name("out" + (".gcode.3mf" if path.name.endswith(".3mf") else ".gcode"))
    words = [word.format(file=path, out=out) for word in kind.command]
    started = time.monotonic()
    code, said = (_forked if forked or not words else _command)(kind, path, words)
    what = ""
    if code == -signal.SIGXCPU:
        what = f"not done after {MOST_S} s of the processor"
    elif code not in ((0, 1, 2) if "verify" in words else (0, 2)):
        what = f"exit code {code} after {time.monotonic() - started:.0f} s: {said[-200:]!r}"
    elif b"\x1b]" in said or b"Traceback" in said:
        what = f"said {said[-200:]!r}"
    elif code == 0 and "plan" in words:
        what = _lost(path, out, said.decode("utf-8", "replace"))
    return code, what


def _lost(path: Path, out: Path, said: str) -> str:
    """Return which commands of a source its result lacks, but for what the run left out."""
    source, result = load_text(path, None), load_text(out, None)
    if faults := check_book(result, source):
        return f"lost {faults[0].text}"
    lost = [] if _SAID.search(said) else lost_commands(source, result)
    return f"lost {lost[:3]}" if lost else ""


def _limited() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
    used = int(sum(resource.getrusage(resource.RUSAGE_SELF)[:2]))
    resource.setrlimit(resource.RLIMIT_CPU, (used + MOST_S, used + MOST_S))


def _command(kind: Format, path: Path, words: list[str]) -> tuple[int, bytes]:
    """Return exit code and words of a command, run as a user runs it."""
    command = [sys.executable, "-m", "decmcts.cli", *words]
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=WAIT_S, check=False, preexec_fn=_limited
        )
    except subprocess.TimeoutExpired:
        return -signal.SIGXCPU, b""
    return done.returncode, done.stderr + done.stdout


def _forked(kind: Format, path: Path, words: list[str]) -> tuple[int, bytes]:
    """Return exit code and words of a command, or of a reader, run in a fork of this process."""
    said = path.with_name("said")
    child = os.fork()
    if child == 0:
        code = 99
        try:
            signal.alarm(int(WAIT_S))
            _limited()
            with said.open("wb") as file:
                os.dup2(file.fileno(), 1)
                os.dup2(file.fileno(), 2)
            code = run(words) if words else 2 * (not refused_or_read(kind, path))
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return (-signal.SIGXCPU if code == -signal.SIGALRM else code), said.read_bytes()


START = (
    "; generated by PrusaSlicer 2.5.0\nM104 S215\nG28\nG90\nM83\nM106 S100\nM204 P900\n"
    "; filament_diameter = 1.75\n"
)
LOOP = (
    "G1 E-.8 F2400\nG1 X{x} Y20 F9000\nG1 E.8 F2400\n;TYPE:Perimeter\nG1 X{r} Y20 E.66 F1800\n"
    "G1 X{r} Y40 E.66\nM106 S{x}\nG1 X{x} Y40 E.66\nG1 X{x} Y20.2 E.66 ; (end)\n"
)


def gcode() -> bytes:
    """Return a print of six loops on three layers with labels, a pause and a message."""
    layers = (
        f";LAYER_CHANGE\n;Z:{z}\n;HEIGHT:0.2\nG1 Z{z} F600\nM486 S{k}\n"
        + LOOP.format(x=20, r=40) + LOOP.format(x=60, r=80) + ("M600\n" if k == 1 else "M117 on\n")
        for k, z in enumerate((0.2, 0.4, 0.6))
    )  # fmt: skip
    return (START + "".join(layers) + "M104 S0\nM84\n").encode()


def bgcode() -> bytes:
    """Return the same as binary G-code, its metadata packed, its G-code not."""
    raw = b"GCDE" + struct.pack("<IH", 1, 1)
    for kind, content in ((0, b"Producer=x\n"), (3, b"a=b\n"), (4, b"c=d\n"), (2, b"e=f\n")):
        packed = zlib.compress(content)
        block = struct.pack("<HHII", kind, 1, len(content), len(packed)) + b"\0\0" + packed
        raw += block + struct.pack("<I", zlib.crc32(block))
    block = struct.pack("<HHI", 1, 0, len(gcode())) + b"\0\0" + gcode()
    return raw + block + struct.pack("<I", zlib.crc32(block))


def plate(text: bytes) -> bytes:
    """Return a .gcode.3mf with one plate."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Metadata/plate_1.gcode", text)
        archive.writestr("Metadata/a.txt", b"x")
    return out.getvalue()


def stl() -> bytes:
    """Return a tetrahedron in words."""
    corners = ((0, 0, 0), (9, 0, 0), (0, 9, 0), (0, 0, 9))
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    rows = ["solid a"]
    for face in faces:
        rows += ["facet normal 0 0 1", "outer loop"]
        rows += [f"vertex {x} {y} {z}" for x, y, z in (corners[k] for k in face)]
        rows += ["endloop", "endfacet"]
    return "\n".join([*rows, "endsolid a", ""]).encode()


def plan() -> bytes:
    """Return the plan that prints the six loops as they are."""
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "a.gcode", Path(folder) / "plan.json"
        source.write_bytes(gcode())
        job, _ = read_gcode(source)
        machine = load_machine("mk4s")
        graph = order_rules(job, machine, process_order="keep", quality=True)
        order = np.arange(len(job.contours), dtype=np.int32)
        made = schedule(job, machine, graph, [Toolpath.of(order, np.zeros(len(order), np.bool_))])
        write_plan(PlanDocument("", machine, job.contours, graph.pairs(), made, {}), out)
        return out.read_bytes()


def machine() -> bytes:
    """Return a machine file."""
    return (Path(decmcts.__file__).parent / "machines" / "mk4s.toml").read_bytes()


def record() -> bytes:
    """Return a recording of three states."""
    heads = [cells_of(AgentStatus(k, name), 1.0) for k, name in enumerate(("left", "right"))]
    states = [json.dumps({"at_s": 0.1 * k, "heads": heads}) for k in range(3)]
    return "\n".join([f'{BEGINS}, "bound_s": 1.0}}', *states, ""]).encode()


DIGEST = "0123456789abcdef" * 2
_AGREED = kinds.Proposal(
    (0, 1), {1: np.array([4, 1, 2], np.int32), 0: np.array([], np.int32)}, 12.5, DIGEST
)
MESSAGES: tuple[kinds.Message, ...] = (
    kinds.Hello(DIGEST, 1, "l", True), kinds.Commit((0, 2), DIGEST, kinds.Stage.AGREED, 7, (0, 9)),
    kinds.PlanRequest(1, (0, 1), DIGEST), kinds.Beat(150), kinds.Goodbye("", "terminated"), _AGREED,
    kinds.Joint((0, 1), {1: np.array([4, 1, 2], np.int32), 0: np.arange(99, dtype=np.int32)}, 12.5),
    kinds.PlanReply(1, _AGREED),
    kinds.Distribution((np.array([3, 1, 2], np.int32), np.zeros(1, np.int32)), np.full(2, 0.5)),
)  # fmt: skip


def message(kind: int = 0) -> bytes:
    """Return what one agent says to another, of one kind."""
    return encode(kinds.Envelope(1, 5, 9, MESSAGES[kind]))


def _message_of(path: Path) -> object:
    """Unpack a message; what is taken must be what it is when it is said again."""
    try:
        heard = decode(path.read_bytes())
    except kinds.MessageError as error:
        raise InputError(str(error), path=path) from error
    again = encode(heard)
    if encode(decode(again)) != again:
        raise ValueError("a message is another when it is said again")
    return heard


def _machine_of(path: Path) -> object:
    return load_machine(str(path))


def _solid_of(path: Path) -> object:
    return load_solid(path, Bed())


_PLAN = ("plan", "{file}", "-o", "{out}", "--machine", "mk4s", "--time-limit", "0.2",
         "--allow-slower", "--no-certificate")  # fmt: skip
FORMATS = (
    Format("a.gcode", gcode, read_gcode, _PLAN),
    Format("a.bgcode", bgcode, read_gcode, _PLAN),
    Format("a.gcode.3mf", lambda: plate(gcode()), read_gcode, _PLAN),
    Format("a.stl", stl, _solid_of, ()),  # commands give it to a slicer
    Format("plan.json", plan, read_plan, ("verify", "{file}")),
    Format("own.toml", machine, _machine_of, ("machines", "--machine", "{file}")),
    Format("a.rec", record, read_record, ("replay", "{file}", "--speed", "1000")),
    Format("a.message", message, _message_of, ()),
)


def main() -> None:
    """Fuzz each format with a fresh seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=20, help="of each format")
    parser.add_argument("--seed", type=int, default=None, help="default: a fresh one")
    parser.add_argument("--forked", action="store_true", help="run in forks of this process")
    parser.add_argument("--of", default="", help="formats, with commas; default: all")
    given = parser.parse_args()
    seed = given.seed if given.seed is not None else int(time.time_ns() % 2**31)
    print(f"seed {seed}\n\n| format | files | exit code 0 | 1 | 2 | wrong | processor s, mean |")
    print("|---|---|---|---|---|---|---|")
    wrong = 0
    for number, kind in enumerate(FORMATS):
        if not given.of or kind.name in given.of.split(","):
            rng = np.random.default_rng([seed, number])
            wrong += _fuzz(kind, rng, given.files, f"fuzz-{seed}", forked=given.forked)
    sys.exit(min(wrong, 1))


def _fuzz(kind: Format, rng: np.random.Generator, files: int, name: str, *, forked: bool) -> int:
    """Run damaged files of one format, keep what goes wrong, and print a row; returns how many."""
    honest, codes, wrong = kind.make(), Counter[int](), 0
    for k in range(-1, files):  # the first is honest: with it a fork's parent loads the program
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / kind.name
            path.write_bytes(honest if k < 0 else kind_damaged(kind, honest, rng))
            if k < 0:
                if forked:
                    _load(kind, path)
                before = sum(os.times()[:4])
                continue
            code, what = run_one(kind, path, forked=forked)
            codes[code] += 1
            if what:
                wrong += 1
                kept = Path(tempfile.gettempdir()) / f"{name}-{k}-{kind.name}"
                kept.write_bytes(path.read_bytes())
                print(json.dumps({"file": str(kept), "wrong": what}), flush=True)
    spent = (sum(os.times()[:4]) - before) / files
    ends = " | ".join(str(codes[code]) for code in (0, 1, 2))
    print(f"| {kind.name} | {files} | {ends} | {wrong} | {spent:.2f} |", flush=True)
    return wrong


def _load(kind: Format, path: Path) -> None:
    """Run the command on an honest file in this process, so that its forks find all loaded."""
    words = [word.format(file=path, out=path.with_name("first.gcode")) for word in kind.command]
    with Path(os.devnull).open("w") as nothing, redirect_stdout(nothing), redirect_stderr(nothing):
        run(words) if words else kind.read(path)


def kind_damaged(kind: Format, honest: bytes, rng: np.random.Generator) -> bytes:
    """Return a damaged file of a kind; of binary G-code often one with right checksums."""
    if kind.name.endswith(".3mf") and rng.integers(2):
        return plate(damaged(gcode(), rng))
    if kind.name.endswith(".message"):
        honest = message(int(rng.integers(len(MESSAGES))))
    raw = damaged(honest, rng)
    if kind.name.endswith(".bgcode") and rng.integers(4):
        return checksums_mended(raw)
    return raw


if __name__ == "__main__":
    main()
