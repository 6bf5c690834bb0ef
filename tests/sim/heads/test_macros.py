"""The macros that are shipped: files that use them pass, and a text that breaks a rule is seen."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_dict import machine_from_dict, machine_to_dict
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.machine import Machine
from decmcts.print.plan import ACTION_END
from sim.faults import FaultKind
from sim.heads.file import read_head_file
from sim.heads.plan import plan_of_files
from tests.sim.heads.macro_rules import check_macros
from tests.sim.heads.test_together import Made, cut, nth
from tests.sim.test_head_points import half_way, two_heads

ROOT = Path(__file__).parents[3] / "examples" / "macros"
KINDS = ("klipper", "reprapfirmware")


def machine_with(kind: str, **fields: Any) -> Machine:
    """A machine of two heads whose file has what is shipped for these controllers."""
    words = tomllib.loads((ROOT / kind / "words.toml").read_text())
    return machine_from_dict(machine_to_dict(load_machine("dual-gantry")) | words | fields)


def texts(kind: str) -> dict[str, str]:
    macros = (path for path in (ROOT / kind).iterdir() if path.suffix in (".g", ".cfg"))
    return {path.name: path.read_text() for path in macros}


def written(folder: Path, kind: str) -> Made:
    """Files of two heads that signal points, with these words."""
    machine = machine_with(kind)
    return Made(
        folder, change=half_way, release=machine.release, words=machine.words,
        interval_s=machine.signal_interval_s,
    )  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_shipped_macros_keep_the_rules(kind: str) -> None:
    """By the judge's own reading of their text."""
    assert texts(kind) and check_macros(machine_with(kind), texts(kind)) == []


@pytest.mark.parametrize("kind", KINDS)
def test_files_that_use_them_pass(tmp_path: Path, kind: str) -> None:
    """With their plan, and read without it."""
    made = written(tmp_path, kind)
    assert made.judged().faults == ()
    files = [read_head_file(path, made.words) for path in made.paths]
    document, faults = plan_of_files(files, made.job, two_heads(made))
    assert faults == []
    points = [head.after_point[head.after_point != ACTION_END] for head in document.plan.heads]
    assert [list(each) for each in points] == [[1], [1]]


@pytest.mark.parametrize("kind", KINDS)
def test_the_output_changes_at_each_signal(tmp_path: Path, kind: str) -> None:
    """The other controller counts changes: the same value twice would be none."""
    for path in written(tmp_path, kind).paths:
        levels = re.findall(r"^(?:SET_PIN PIN=sync VALUE=|M42 P1 S)(\d)$", path.read_text(), re.M)
        assert len(levels) > 3
        assert levels == [str(count % 2) for count in range(1, len(levels) + 1)]


SIGNAL, WAIT = r"^(?:SET_PIN|M42) .*\n", r"^(?:SYNC_WAIT|M98) .*\n"
SPOILT = {
    "a signal of the same level": lambda t: cut(t, m := nth(t, SIGNAL, 2), flipped(m[0])),
    "a signal dropped": lambda t: cut(t, nth(t, SIGNAL, 2)),
    "a signal twice": lambda t: cut(t, m := nth(t, SIGNAL, 2), m[0] * 2),
    "a signal and its change back": lambda t: cut(t, m := nth(t, SIGNAL, 2), m[0] + flipped(m[0])),
    "a wait for one signal less": lambda t: cut(t, m := nth(t, WAIT, 2), counted(m[0], -1)),
    "a wait for one signal more": lambda t: cut(t, m := nth(t, WAIT, 2), counted(m[0], 1)),
    "a wait for another head": lambda t: cut(t, m := nth(t, WAIT, 2), other(m[0])),
    "a wait dropped": lambda t: cut(t, nth(t, WAIT, 2)),
    "done without a stop": lambda t: cut(t, nth(t, "M400\n", -1)),
}  # fmt: skip


def flipped(line: str) -> str:
    return line[:-2] + str(1 - int(line[-2])) + "\n"


def counted(line: str, more: int) -> str:
    return re.sub(r"\d+\n", lambda m: f"{int(m[0]) + more}\n", line)


def other(line: str) -> str:
    return re.sub(r"H(EAD=)?(\d)", lambda m: f"H{m[1] or ''}{3 - int(m[2])}", line)


@pytest.mark.parametrize("head", [0, 1])
@pytest.mark.parametrize("name", SPOILT)
@pytest.mark.parametrize("kind", KINDS)
def test_spoilt_files_are_seen(tmp_path: Path, kind: str, name: str, head: int) -> None:
    """A count that is wrong by one is wrong for good."""
    made = written(tmp_path, kind)
    text = made.paths[head].read_text()
    made.paths[head].write_text(SPOILT[name](text))
    assert text != made.paths[head].read_text()
    assert not made.judged().ok


BROKEN = [
    ("reprapfirmware", "sync_reset.g", "S0", "S{0}", "is not queued"),
    ("reprapfirmware", "sync.g", "M42 P1 S0", "M42 P1 S{var.x}", "is not queued"),
    ("reprapfirmware", "sync.g", "M42 P1 S0", "M596 P1", "motion system 0 only"),
    ("reprapfirmware", "sync.g", " T3 S0", " T2 S0", "a trigger of their own"),
    ("reprapfirmware", "sync.g", "M581 P2 T3", ";M581 P2 T3", "a trigger of their own"),
    ("reprapfirmware", "trigger3.g", "+ 1", "+ 2", "does not count"),
    ("reprapfirmware", "trigger2.g", "set", ";set", "does not count"),
    ("reprapfirmware", "trigger2.g", "[2]", "[3]", "does not count"),
    ("reprapfirmware", "sync_wait.g", "while", "if", "does not wait"),
    ("reprapfirmware", "sync_wait.g", "<", "<=", "does not wait"),
    ("reprapfirmware", "sync_wait.g", "  G4 P10", "  M577 P2", "does not wait"),
    ("klipper", "sync.cfg", "VALUE=0", "VALUE=1\n    SET_PIN PIN=sync VALUE=0", "twice"),
    ("klipper", "sync.cfg", "SET_PIN PIN=sync VALUE=0", "RESUME", "RESUME before its PAUSE"),
    ("klipper", "sync.cfg", "SET_PIN PIN=sync VALUE=0", "M400", "rendered before"),
    ("klipper", "sync.cfg", "macro SYNC_RESET", "macro SYNC_WAIT", "no macro waits"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "name", "old", "new", "what"), BROKEN)
def test_macros_that_break_a_rule_are_seen(
    kind: str, name: str, old: str, new: str, what: str
) -> None:
    """Each of these was seen to lose a signal, or to give one early."""
    broken = texts(kind)
    assert old in broken[name]
    broken[name] = broken[name].replace(old, new)
    found = check_macros(machine_with(kind), broken)
    assert any(what in fault.text for fault in found), found


WORDS = [
    ("passed", "M400 {level}", "stops the head"),
    ("passed", "G4 P{level}", "stops the head"),
    ("passed", "M118 S{number}", "when it is read"),
    ("passed", 'M98 P"passed.g" C{count}', "when it is read"),
    ("passed", "RESPOND MSG={number}", "when it is read"),
    ("passed", "M42 P1 S1", "the same for every signal"),
    ("passed", "M42 P1 S{level}.{count}", "is not queued"),
    ("wait", "PAUSE N={number}", "never goes on"),
    ("wait", "M598 P{number}", "motion systems"),
]


@pytest.mark.parametrize(("name", "line", "what"), WORDS)
def test_words_that_break_a_rule_are_seen_in_files(
    tmp_path: Path, name: str, line: str, what: str
) -> None:
    """Whatever the macros behind them do."""
    words = {"wait": "SYNC_WAIT H={head} C={count}", name: line}
    machine = machine_with("klipper", words=words)
    made = Made(tmp_path, change=half_way, release="point", words=machine.words, interval_s=0.1)
    if "M598" in line:  # refused as the file of a board with two motion systems
        assert not made.judged().ok
        return
    verdict = made.judged()
    assert any(what in fault.text for fault in verdict.faults), verdict.faults
    assert FaultKind.COMMAND in verdict.kinds()


def test_klipper_needs_its_interval() -> None:
    """Of changes nearer than 0.1 s none may come."""
    found = check_macros(machine_with("klipper", signal_interval_s=0.05), texts("klipper"))
    assert ["nearer than 0.1 s" in fault.text for fault in found] == [True]


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ({"wait": "SYNC_WAIT"}, "to say what it waits for"),
        ({"wait": "SYNC_WAIT {count}"}, "to say what it waits for"),
        ({"wait": "SYNC_WAIT {number} {count} {head}"}, "to say what it waits for"),
        ({"signal": "SYNC_SIGNAL"}, r"must have \{number\}"),
        ({"signal": "GO {who} {number}"}, "none of number, head, count, level"),
        ({"signal": "GO {number:3}"}, "more than a name"),
        ({"signal": "GO {number"}, "expected"),
        ({"signal": "GO {number}{count}{level}"}, "nothing between"),
        ({"signal": "GO {number} ; now"}, "without a comment"),
        ({"signal": "GO {number}\nM112"}, "one line"),
        ({"passed": " "}, "one line"),
        ({"signal": "SYNC_WAIT N={number}"}, "what a signal is too"),
        ({"sign": "GO"}, "sign"),
    ],
)
def test_words_no_file_can_have_are_refused(words: dict[str, str], what: str) -> None:
    """In the machine file, before anything is planned for it."""
    with pytest.raises(InputError, match=what):
        machine_with("klipper", words=words)


class Printer:
    """What the module uses of Klipper: time passes only while it waits."""

    def __init__(self, pins: dict[str, str], changes: list[tuple[float, str]]) -> None:
        self.now, self.changes, self.drained = 0.0, sorted(changes), 0
        self.pins = pins
        self.inputs: dict[str, Any] = {}
        self.commands: dict[str, Any] = {}

    def get_printer(self) -> Printer:
        return self

    get_reactor = get_printer

    def load_object(self, config: Any, name: str) -> Printer:
        assert name == "buttons"
        return self

    def lookup_object(self, name: str) -> Printer:
        assert name in ("gcode", "toolhead")
        return self

    def get_prefix_options(self, prefix: str) -> list[str]:
        return [name for name in self.pins if name.startswith(prefix)]

    def get(self, option: str) -> str:
        return self.pins[option]

    def register_buttons(self, pins: list[str], callback: Any) -> None:
        self.inputs[pins[0]] = callback

    def register_command(self, name: str, call: Any) -> None:
        self.commands[name] = call

    def monotonic(self) -> float:
        return self.now

    def get_last_move_time(self) -> None:
        self.drained += 1

    def is_shutdown(self) -> bool:
        return self.now > 100.0

    def pause(self, until: float) -> float:
        while self.changes and self.changes[0][0] <= until:
            at, pin = self.changes.pop(0)
            self.inputs[pin](at, 1)
        self.now = until
        return self.now

    def run(self, name: str, **values: int) -> float:
        def error(text: str) -> ValueError:
            return ValueError(text)

        self.commands[name](SimpleNamespace(get_int=lambda key, minval=0: values[key], error=error))
        return self.now


def module(changes: list[tuple[float, str]]) -> Printer:
    spec = importlib.util.spec_from_file_location("sync_wait", ROOT / "klipper" / "sync_wait.py")
    assert spec is not None and spec.loader is not None
    code = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(code)
    printer = Printer({"pin_2": "PC1", "pin_3": "PC2", "other": "x"}, changes)
    code.load_config(printer)
    return printer


def test_klippers_module_waits_for_so_many_signals_of_one_head() -> None:
    """Those of another head do not count, and early ones are not lost."""
    printer = module([(1.0, "PC1"), (1.5, "PC2"), (1.6, "PC2"), (2.0, "PC1"), (3.0, "PC1")])
    assert printer.run("SYNC_WAIT", HEAD=2, COUNT=2) == pytest.approx(2.0, abs=0.06)
    assert printer.drained > 0
    before = printer.drained
    assert printer.run("SYNC_WAIT", HEAD=3, COUNT=2) == pytest.approx(2.0, abs=0.06)
    assert printer.run("SYNC_WAIT", HEAD=2, COUNT=1) == pytest.approx(2.0, abs=0.06)
    assert printer.drained == before  # what was given already stops nothing
    assert printer.run("SYNC_WAIT", HEAD=2, COUNT=3) == pytest.approx(3.0, abs=0.06)


def test_klippers_module_forgets_and_ends() -> None:
    """A second print counts anew; a printer that is shut down waits no more."""
    printer = module([(1.0, "PC1")])
    printer.run("SYNC_WAIT", HEAD=2, COUNT=1)
    printer.run("SYNC_FORGET")
    assert printer.run("SYNC_WAIT", HEAD=2, COUNT=1) > 100.0
    with pytest.raises(ValueError, match="pin_7"):
        printer.run("SYNC_WAIT", HEAD=7, COUNT=1)
    assert np.isfinite(printer.now)
