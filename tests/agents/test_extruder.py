"""The command line of one agent: what it refuses, and how it says so."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from agents.extruder import arguments, main, options_of
from tests.agents.toy import ToyPlanner


def toy(needed: int | None = None):  # type: ignore[no-untyped-def]
    return lambda given: ToyPlanner(given.head, names=("left", "right"), needed=needed)


@pytest.fixture(autouse=True)
def _keep_signals() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.slow
def test_an_agent_alone_writes_its_plan(tmp_path: Path) -> None:
    """Single-extruder mode by hand: no ports, no network."""
    target = tmp_path / "plan.json"
    given = ["--head", "1", "--time-limit", "0.2", "--output", str(target)]
    assert main(given, make_planner=toy()) == 0
    written = json.loads(target.read_text())
    assert written["live"] == [1]
    assert sorted(written["plans"]["1"]) == list(range(40))


def test_an_agent_alone_that_cannot_print_everything_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is not to wait for others for ever: nobody can come."""
    monkeypatch.setattr("agents.extruder._step_to_the_end", lambda agent, linger_s: 1 / 0)
    assert main(["--head", "1"], make_planner=toy(needed=0)) == 2
    assert capsys.readouterr().err == "decmcts: only left can do job 0\n"


def test_a_plan_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The folder may be gone by then."""
    given = ["--head", "1", "--time-limit", "0", "--output", str(tmp_path / "gone" / "plan.json")]
    assert main(given, make_planner=toy()) == 2
    assert (
        capsys.readouterr().err.splitlines()[-1].startswith(f"decmcts: {tmp_path}/gone/plan.json")
    )


def test_options_are_read(tmp_path: Path) -> None:
    """Agents by hand are given addresses, also of other hosts, and a file with their secret."""
    secret = tmp_path / "secret"
    secret.write_bytes(b"correct horse battery\n")
    secret.chmod(0o600)
    words = "--head 1 --addresses 7001,other:7002 --fenced 2,3 --seed 4 --controlled --secret"
    options = options_of(arguments().parse_args([*words.split(), str(secret)]))
    assert (options.head, options.fenced, options.seed) == (1, (2, 3), 4)
    assert options.meeting is not None and options.controlled
    assert options.meeting.places == ("tcp/127.0.0.1:7001", "tcp/other:7002")
    assert options.meeting.secret == b"correct horse battery"
    assert "horse" not in repr(options)
    assert options.epoch > 1_700_000_000_000


@pytest.mark.parametrize(
    ("content", "mode", "said"),
    [
        (None, 0o600, "no secret here: No such file"),
        ("short", 0o600, "no secret here: a secret of 5 bytes, least 16"),
        ("long enough, but for all to read", 0o644, "other users may read this secret"),
        ("x" * 9999, 0o600, "a secret has at most 4096 bytes"),
    ],
)
def test_a_secret_that_is_none_is_refused(
    tmp_path: Path, content: str | None, mode: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whoever reads it may speak for every head."""
    secret = tmp_path / "secret"
    if content is not None:
        secret.write_text(content)
        secret.chmod(mode)
    words = ["--head", "0", "--addresses", "7001,7002", "--secret", str(secret)]
    assert main(words, make_planner=toy()) == 2
    shown = capsys.readouterr().err
    assert shown.startswith(f"decmcts: {secret}: {said}") and shown.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("--head 0", "decmcts: no print given; name a file, or a folder with --pack"),
        ("--head 0 --pack /nowhere", "decmcts: /nowhere: no problem pack: "),
        ("nowhere.gcode --head 0", "decmcts: nowhere.gcode: no such file"),
        ("--head one", "decmcts: argument --head: invalid int value: 'one'; --help lists"),
        ("--head 0 --addresses x", "decmcts: argument --addresses: invalid addresses value: 'x'"),
        ("--head 0 --addresses 7001,7002", "decmcts: --addresses without --secret: anybody could"),
        ("--head 0 --silence nan", "decmcts: --silence nan, allowed 1..600 seconds"),
        ("--head 0 --time-limit inf", "decmcts: --time-limit inf, must be at least 0 and finite"),
        ("--head 0 --silence 0.5", "decmcts: --silence 0.5, allowed 1..600 seconds"),
        ("", "decmcts: the following arguments are required: --head; --help lists what"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    words: str, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The launcher shows the last line of a dead agent."""
    assert main(words.split()) == 2
    shown = capsys.readouterr().err
    assert shown.startswith(line) and shown.count("\n") == 1


def test_another_problem_than_expected_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """A launcher of another version must not get plans of this one."""
    assert main(["--head", "0", "--expect", "ab" * 16], make_planner=toy()) == 2
    assert "the launcher's has abababababab" in capsys.readouterr().err


def test_a_crash_is_one_line_unless_debugged(capsys: pytest.CaptureFixture[str]) -> None:
    """A trace of another process helps nobody but us."""

    def crash(_: object) -> ToyPlanner:
        raise ZeroDivisionError("oops")

    assert main(["--head", "0"], make_planner=crash) == 1
    assert capsys.readouterr().err == "decmcts: ZeroDivisionError: oops\n"
    with pytest.raises(ZeroDivisionError):
        main(["--head", "0", "--debug"], make_planner=crash)


def test_toy_digest_depends_on_the_jobs() -> None:
    """The refusal tests stand on this."""
    one, other = (ToyPlanner(0, names=("a", "b"), jobs=n) for n in (40, 41))
    assert one.problem != other.problem
    assert np.isfinite(one.lengths).all()
