"""plan.json: exact round trips, and a line for each thing that is malformed."""

from __future__ import annotations

import copy
import gzip
import json
import re
import tempfile
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_dict import machine_to_dict
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.print.contours import Contours
from decmcts.print.plan import (
    ACTION_END,
    ActionKind,
    After,
    HeadActions,
    JointPlan,
    OrderRules,
    PlanDocument,
)

DOCS = Path(__file__).parents[3] / "docs"


def contours(n: int, size: int = 4, *, seed: int = 0, climbing: int = -1) -> Contours:
    """Random polylines, each on its own height; number `climbing` rises along its way."""
    rng = np.random.default_rng(seed)
    points = rng.random((n * size, 3)) * 200.0
    points[:, 2] = np.repeat(np.arange(n) * 0.2 + 0.2, size)
    if climbing >= 0:
        points[climbing * size : (climbing + 1) * size, 2] += np.linspace(0.0, 0.2, size)
    start = np.arange(n) * size
    extrusion, feed = rng.random(n * size), np.full(n * size, 60.0)
    feed[size - 1 : size] = 30.0
    extrusion[start] = feed[start] = 0.0
    return Contours(
        points=points,
        offsets=np.arange(n + 1, dtype=np.int64) * size,
        extrusion=extrusion,
        feed=feed,
        width=rng.random(n),
        height=np.full(n, 0.2),
        role=(np.arange(n) % 15).astype(np.int8),
        closed=np.arange(n) % 2 == 0,
        layer=np.arange(n, dtype=np.int32),
        tool=(np.arange(n) % 2).astype(np.int16),
        reversible=np.arange(n) % 3 == 0,
        epoch=(np.arange(n) // 2).astype(np.int32),
        line=np.arange(n, dtype=np.int32) * 7,
    )


def actions(head: str, other: int, printed: Contours, ids: list[int]) -> HeadActions:
    """One head that prints `ids`, the first two after the other head's, or its point 3."""
    k = len(ids) + 1
    paths = [*(printed.polyline(i) for i in ids), np.array([[0.0, 1.0, 2.0]])]
    return HeadActions(
        head=head,
        kind=np.array([ActionKind.PRINT] * len(ids) + [ActionKind.PARK], np.int8),
        contour=np.array([*ids, -1], np.int32),
        reversed=(np.arange(k) % 2 == 1) & (np.arange(k) < len(ids)),
        entry=np.array([1] + [0] * (k - 1), np.int32),
        path_offsets=np.cumsum([0, *map(len, paths)]).astype(np.int64),
        path=np.concatenate(paths),
        begin_s=np.arange(k) / 3.0,
        end_s=np.arange(1, k + 1) / 3.0,
        after_offsets=np.minimum(np.arange(k + 1), 2).astype(np.int64),
        after_head=np.full(2, other, np.int32),
        after_action=np.array([0, 1], np.int32),
        after_point=np.array([ACTION_END, 3], np.int32),
        after_lag_s=np.array([0.0, 1 / 3]),
    )


def document(n: int = 6, size: int = 4) -> PlanDocument:
    printed = contours(n, size, climbing=2)
    ids = list(range(n))
    plan = JointPlan(
        (actions("left", 1, printed, ids[::2]), actions("right", 0, printed, ids[1::2]))
    )
    pairs = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1).astype(np.int32)
    metrics = {"travel_mm": np.float64(1.25), "planner": "local", "history": np.arange(3)}
    return PlanDocument("cafe", load_machine("dual-gantry"), printed, pairs, plan, metrics)


def assert_same(a: PlanDocument, b: PlanDocument) -> None:
    assert a.problem == b.problem
    assert machine_to_dict(a.machine) == machine_to_dict(b.machine)
    for name in Contours.__slots__:
        left, right = getattr(a.contours, name), getattr(b.contours, name)
        if left is None or right is None:
            assert left is right, name  # nothing is cut
            continue
        assert left.dtype == right.dtype, name
        np.testing.assert_array_equal(left, right, err_msg=name)
    np.testing.assert_array_equal(a.precedence, b.precedence)
    for one, two in zip(a.plan.heads, b.plan.heads, strict=True):
        assert one.head == two.head
        for name in HeadActions.__slots__[1:]:
            left, right = getattr(one, name), getattr(two, name)
            assert left.dtype == right.dtype, name
            np.testing.assert_array_equal(left, right, err_msg=name)


@pytest.mark.parametrize("name", ["plan.json", "plan.json.gz"])
def test_round_trip_is_exact_to_the_bit(tmp_path, name):
    """The problem's digest is of the bits; a rounded number would be another problem."""
    before = document()
    write_plan(before, tmp_path / name)
    assert_same(before, read_plan(tmp_path / name))


def test_pieces_are_kept(tmp_path):
    """Of a cut print, version 3; what is cut stands among the rules."""
    whole = document()
    n = len(whole.contours)
    sizes = np.diff(whole.contours.offsets)
    along = np.concatenate([np.arange(size) + 0.25 for size in sizes])
    pieces = replace(whole.contours, of=np.zeros(n, np.int32), along=along)
    cut = replace(whole, contours=pieces, rules=OrderRules(cut="inside"))
    write_plan(cut, tmp_path / "plan.json")
    assert json.loads((tmp_path / "plan.json").read_text())["version"] == 3
    read = read_plan(tmp_path / "plan.json")
    assert_same(cut, read)
    assert read.rules == cut.rules
    text = (tmp_path / "plan.json").read_text()
    for right, wrong, message in (
        ('"cut":"inside"', '"cut":"half"', "'half' is none of none, inside, all"),
        ('"of":0', '"of":-1', "of"),
        ('"along":[0.25,', '"along":[', "places, one a point"),
    ):
        (tmp_path / "plan.json").write_text(text.replace(right, wrong, 1))
        with pytest.raises(InputError, match=message):
            read_plan(tmp_path / "plan.json")


def test_version_1_is_still_read(written):
    """Plans of before name actions only, and wait for their ends."""
    old = copy.deepcopy(written)
    for action in (action for head in old["heads"] for action in head["actions"]):
        action["after"] = [edge[:2] for edge in action["after"]]
    heads = write_and_read({**old, "version": 1}).plan.heads
    assert heads[0].after_edges(1) == [After(1, 1, ACTION_END, 0.0)]
    with pytest.raises(InputError, match=r"after\[0\]: expected \[head, action, point, lag\]"):
        write_and_read(old)


def test_accelerations_are_kept(tmp_path):
    """Of all contours or of none: half a statement would be judged as a whole one."""
    plain = document()
    stated = np.arange(len(plain.contours.points)) * 10.0
    stated[plain.contours.offsets[:-1]] = 0.0
    for given in (None, stated):
        write_plan(replace(plain, acceleration=given), tmp_path / "plan.json")
        read = read_plan(tmp_path / "plan.json").acceleration
        assert read is None if given is None else read.tolist() == stated.tolist()
    plan = json.loads((tmp_path / "plan.json").read_text())
    for value, message in (
        (-1.0, "acceleration"),
        ([1.0], "acceleration: 1 values for"),
        ("fast", "acceleration: expected"),
    ):
        contours = [{**row, "acceleration": value} for row in plan["contours"]]
        with pytest.raises(InputError, match=message):
            write_and_read({**plan, "contours": contours})
    del plan["contours"][0]["acceleration"]
    with pytest.raises(InputError, match=r"contours\[0\].*acceleration"):
        write_and_read(plan)


def test_rules_are_kept(tmp_path):
    """A judge has to know what a plan was made by; a rule half said is refused."""
    for rules in (None, OrderRules("free", False, 3, "fixed"), OrderRules()):
        write_plan(replace(document(), rules=rules), tmp_path / "plan.json")
        assert read_plan(tmp_path / "plan.json").rules == rules
    plan = json.loads((tmp_path / "plan.json").read_text())
    for key, value, message in (
        ("process_order", "any", "rules.process_order: 'any' is none of keep, free"),
        ("freedom", 3, "rules.freedom: expected a text"),
        ("quality", 1, "rules.quality: expected true or false"),
        ("max_layers_ahead", -1, "rules.max_layers_ahead: expected an integer"),
        ("max_layers_ahead", 10**4000, "rules.max_layers_ahead: expected an integer"),
        ("speed", 1, "rules.speed: unknown key"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            write_and_read({**plan, "rules": {**plan["rules"], key: value}})
    with pytest.raises(InputError, match=r"rules\.max_layers_ahead: missing"):
        write_and_read({**plan, "rules": {"process_order": "keep", "freedom": "seam"}})


def test_plan_of_nothing_survives(tmp_path):
    """An idle machine is the smallest plan there is."""
    nothing = contours(0)
    pairs = np.empty((0, 2), np.int32)
    idle = PlanDocument("", load_machine("paper"), nothing, pairs, JointPlan(()), {})
    write_plan(idle, tmp_path / "plan.json")
    assert_same(idle, read_plan(tmp_path / "plan.json"))


def test_gz_is_gzipped_and_the_same_bytes_each_time(tmp_path):
    """Equal plans are compared by their files."""
    for name in ("a.json.gz", "b.json.gz"):
        write_plan(document(), tmp_path / name)
    first, second = (tmp_path / name for name in ("a.json.gz", "b.json.gz"))
    assert first.read_bytes() == second.read_bytes()
    assert gzip.decompress(first.read_bytes()).startswith(b'{"format":"decmcts-plan","version":2,')


def test_file_has_the_keys_of_the_format(tmp_path):
    """Other programs rely on names and on [x, y] points of planar contours."""
    write_plan(document(), tmp_path / "plan.json")
    plan = json.loads((tmp_path / "plan.json").read_text())
    assert list(plan) == [
        "format", "version", "problem", "machine", "contours", "precedence", "heads", "metrics"
    ]  # fmt: skip
    assert {len(p) for p in plan["contours"][0]["points"]} == {2}
    assert plan["contours"][2]["z"] is None
    assert {len(p) for p in plan["contours"][2]["points"]} == {3}
    assert plan["contours"][1]["role"] == "external_perimeter"
    assert plan["heads"][0]["actions"][0]["after"] == [["right", 0, None, 0.0]]
    assert plan["heads"][0]["actions"][1]["after"] == [["right", 1, 3, 1 / 3]]
    assert plan["heads"][0]["actions"][-1]["contour"] is None
    assert plan["metrics"] == {"travel_mm": 1.25, "planner": "local", "history": [0, 1, 2]}


def test_documented_example_is_a_plan():
    """The documentation's example is what people copy."""
    text = (DOCS / "plan-format.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```json\n(.*?)```", text, re.DOTALL)
    write_and_read(json.loads(example))


def test_documented_machine_is_one(tmp_path):
    """Likewise for machine files."""
    text = (DOCS / "machine-format.md").read_text(encoding="utf-8")
    idle, words, example = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert tomllib.loads(idle)["heads"][0]["idle"]["standby_c"] == 170
    (tmp_path / "m.toml").write_text(example + words, encoding="utf-8")
    machine = load_machine(str(tmp_path / "m.toml"))
    assert (
        machine.name == "workshop" and machine.words.wait == "SYNC_WAIT HEAD={head} COUNT={count}"
    )


def write_and_read(plan: Any, folder: Path | None = None) -> PlanDocument:
    with tempfile.TemporaryDirectory() as place:
        file = (folder or Path(place)) / "plan.json"
        file.write_text(json.dumps(plan), encoding="utf-8")
        return read_plan(file)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Any:
    file = tmp_path_factory.mktemp("plan") / "plan.json"
    write_plan(document(), file)
    return json.loads(file.read_text())


FENCED = machine_to_dict(load_machine("dual-gantry"))
FENCED["heads"] = [*FENCED["heads"], {**FENCED["heads"][0], "name": "third", "park": [700, 0, 0]}]
ACTION = ("heads", 1, "actions", 1)
AFTER = (*ACTION, "after", 0)
CONTOUR = ("contours", 1)


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        (("format",), "other", "format: is no 'decmcts-plan'"),
        (("version",), 4, "version: 4 is not 1 or 2 or 3"),
        (("version",), True, "version: True is not 1 or 2 or 3"),
        (("version",), None, "version: None is not 1 or 2 or 3"),
        (("version",), 1, "heads[0].actions[0].after[0]: expected [head, action], found"),
        (("surprise",), 1, "surprise: unknown key"),
        (("machine", "heads"), [], "machine.heads: no head"),
        (("machine", "bed", "max"), [1], "machine.bed.max"),
        (("machine", "heads", 0, "name"), "a/b", "machine.heads[0].name: '/' cannot be"),
        (("machine", "heads", 0, "name"), "\ud800", "machine.heads[0].name: '\\ud800' is no"),
        (("machine", "source"), "\udcff", "machine.source: '\\udcff' is no text"),
        (("problem",), "\ud800", "problem: '\\ud800' is no text"),
        (("machine", "heads", 0, "slices", 0, "polygons", 0), [[0, 0]] * 3, "polygon 1"),
        (("contours",), {}, "contours: expected a list"),
        ((*CONTOUR, "id"), 3, "contours[1].id: 3 stands at place 1"),
        ((*CONTOUR, "points"), [[1, 2]], "contours[1].points: 1 points"),
        ((*CONTOUR, "points", 2), [1, 2, 3], "contours[1].points: row 2 has 3 numbers"),
        ((*CONTOUR, "points", 2), [1, "2"], "contours[1].points: expected numbers, found '2'"),
        ((*CONTOUR, "points", 2), [1, True], "found True"),
        ((*CONTOUR, "points", 2), 7, "contours[1].points: expected lists"),
        ((*CONTOUR, "points", 2), [1, 1e999], "not finite"),
        ((*CONTOUR, "z"), "low", "contours[1].z: expected a finite number"),
        ((*CONTOUR, "points", 2), [1, 1e5], "contours[1].points: number 5 is 100000, not finite"),
        ((*CONTOUR, "points", 2), [1, [[[[[]]]]]], "contours[1].points: expected numbers"),
        ((*CONTOUR, "z"), -1e5, "contours[1].z: expected a finite number up to 10000"),
        ((*CONTOUR, "width"), 1e4, "contours[1].width: expected a finite number up to 100"),
        ((*CONTOUR, "feed"), -1, "contours[1].feed: -1 is below 0"),
        ((*CONTOUR, "extrusion"), [1, -2, 1], "contours[1].extrusion: number 1 is -2, below 0"),
        (("machine", "bed", "max"), [1e5, 1e5], "machine.bed.max: number 0 is 100000"),
        ((*ACTION, "path", 0), [1, 2, 1e5], "heads[1].actions[1].path: number 2 is 100000"),
        (
            (*ACTION, "end_s"),
            1e8,
            "heads[1].actions[1].end_s: expected a finite number up to 1e+07",
        ),
        ((*CONTOUR, "role"), "magic", "contours[1].role: unknown role 'magic'"),
        ((*CONTOUR, "role"), ["x"], "contours[1].role: expected a text"),
        ((*CONTOUR, "head"), "middle", "contours[1].head: 'middle', expected null"),
        ((*CONTOUR, "head"), "left", "contours[1].head: 'left', expected null"),
        ((*CONTOUR, "head"), ["left"], "contours[1].head"),
        ((*CONTOUR, "width"), -1, "contours[1].width: -1 is below 0"),
        ((*CONTOUR, "closed"), 1, "contours[1].closed: expected true or false"),
        ((*CONTOUR, "tool"), 99999, "contours[1].tool: expected an integer in 0..32767"),
        ((*CONTOUR, "extrusion"), [1], "contours[1].extrusion: 1 values for 3 segments"),
        ((*CONTOUR, "feed"), [1, 2, None], "contours[1].feed: expected numbers, found None"),
        (("precedence", 1), [0, 99], "precedence[1]: no contour 99, there are 6"),
        (("precedence", 1), [0, -1], "precedence[1]: no contour -1"),
        (("precedence", 1), [2, 2], "precedence[1]: contour 2 before itself"),
        (("precedence", 1), [3, 2], "precedence[1]: contour 3 before contour 2"),
        (("precedence", 1), [2], "precedence[1]: expected two contour ids"),
        (("precedence", 1), [0, 1.5], "precedence[1]: expected two contour ids"),
        (("heads", 1, "name"), "left", "heads[0].name: 'left' stands for more than one head"),
        (("heads", 1, "name"), "up", "heads[1].name: 'up' is no head of the machine"),
        ((*ACTION, "kind"), "jump", "heads[1].actions[1].kind: unknown kind 'jump'"),
        ((*ACTION, "contour"), 6, "heads[1].actions[1].contour: expected an integer in 0..5"),
        ((*ACTION, "contour"), None, "heads[1].actions[1].contour: expected an integer"),
        (("heads", 0, "actions", 3, "contour"), 2, "actions[3].contour: only a print action"),
        (("heads", 0, "actions", 3, "reversed"), True, "actions[3].reversed: true, but nothing"),
        ((*ACTION, "entry"), 4, "heads[1].actions[1].entry: expected an integer in 0..3"),
        ((*ACTION, "path"), [], "heads[1].actions[1].path: empty"),
        ((*ACTION, "path", 0), [1, 2], "heads[1].actions[1].path: row 0 has 2 numbers"),
        ((*ACTION, "end_s"), 0.1, "heads[1].actions[1].end_s: 0.1 is before begin_s"),
        ((*ACTION, "begin_s"), -0.1, "heads[1].actions[1].begin_s"),
        (AFTER, ["left", 99, None, 0], "heads[1].actions[1].after[0]: 'left' has no action"),
        (AFTER, ["right", 0, None, 0], "after[0]: 'right' is not another head"),
        (AFTER, [["left"], 0, None, 0], "after[0]: ['left'] is not another head"),
        (AFTER, ["left"], "after[0]: expected [head, action, point, lag], found ['left']"),
        (AFTER, ["left", 0], "after[0]: expected [head, action, point, lag]"),
        (AFTER, ["left", True, None, 0], "after[0]: 'left' has no action True"),
        (
            (*AFTER, 2),
            4,
            "heads[1].actions[1].after[0]: action 1 of 'left' has no point 4 to pass; "
            "it has points 1 to 3",
        ),
        (AFTER, ["left", 3, 1, 0], "action 3 of 'left' has no point 1 to pass; it stands"),
        ((*AFTER, 2), 0, "heads[1].actions[1].after[0]: no point 0: a number from 1, or null"),
        ((*AFTER, 2), -1, "after[0]: no point -1"),
        ((*AFTER, 2), 1.0, "after[0]: no point 1.0"),
        ((*AFTER, 2), True, "after[0]: no point True"),
        ((*AFTER, 2), 10**4000, "after[0]: no point 1000"),
        ((*AFTER, 3), -0.5, "heads[1].actions[1].after[0]: a lag of -0.5: 0 to 1e+07 s"),
        ((*AFTER, 3), 1e8, "after[0]: a lag of 100000000.0"),
        ((*AFTER, 3), 1e999, "the number Infinity is not finite"),
        ((*AFTER, 3), None, "after[0]: a lag of None"),
        (("metrics",), 3, "metrics: expected a table"),
        (("fenced",), 3, "fenced: expected a table"),
        (("fenced",), {"at": {}}, "fenced.machine: missing"),
        (("fenced",), {"machine": {}, "at": {}}, "fenced.machine"),
        (("fenced",), {"machine": FENCED, "at": {"left": [1, 2, 3]}}, "fenced.at.left: is none"),
        (("print_with",), [[0, 1]], "print_with: expected a table"),
        (("print_with",), {"left": 1}, "print_with.left: is no tool"),
        (("print_with",), {"0": -1}, "print_with.0: expected an integer"),
        (("fenced",), {"machine": FENCED, "at": {"third": [1, 2]}}, "fenced.at.third"),
    ],
)
def test_malformed_plans_are_refused_with_their_place(written, tmp_path, where, value, message):
    """A plan moves heavy heads: what is not understood is not guessed at."""
    plan = copy.deepcopy(written)
    target = plan
    for key in where[:-1]:
        target = target[key]
    target[where[-1]] = value
    with pytest.raises(InputError) as error:
        write_and_read(plan, tmp_path)
    assert message in str(error.value)
    assert "plan.json" in str(error.value)


@pytest.mark.parametrize(
    "key", ["problem", "machine", "contours", "precedence", "heads", "metrics"]
)
def test_missing_parts_are_named(written, key):
    """A truncated export must not look like an empty plan."""
    with pytest.raises(InputError, match=f"{key}: missing"):
        write_and_read({k: v for k, v in written.items() if k != key})


@pytest.mark.parametrize(
    "content",
    [b"", b"\x00\x01", b"[]", b"3", b"{", b'{"format": "decmcts-plan", "version": 1}',
     b'{"format": NaN}', b"[" * 100_000, b'{"version": ' + b"7" * 5000 + b"}",
     b'{"format": 1, "format": 2}', b'{"format": 1' + b"e9" * 9 + b"}", b"\x1f\x8b broken",
     gzip.compress(b"x" * 99, mtime=0)[:-9]],
)  # fmt: skip
def test_files_that_are_no_plan_are_refused(tmp_path, content):
    """Empty, binary, foreign, truncated and hostile files get a line, not a traceback."""
    file = tmp_path / "plan.json"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"plan\.json"):
        read_plan(file)


def test_a_failed_write_leaves_the_old_file(tmp_path):
    """The last good plan must survive a bad one; nothing half-written stays behind."""
    file = tmp_path / "plan.json"
    write_plan(document(), file)
    kept = file.read_bytes()
    bad = document()
    bad.metrics["travel_mm"] = float("nan")
    with pytest.raises(InputError, match="cannot be written"):
        write_plan(bad, file)
    assert file.read_bytes() == kept
    assert list(tmp_path.iterdir()) == [file]


def test_unwritable_place_is_one_line(tmp_path):
    """A wrong output path must not cost the user a traceback after minutes of planning."""
    with pytest.raises(InputError, match=r"cannot be written \(No such file"):
        write_plan(document(), tmp_path / "nowhere" / "plan.json")


@pytest.mark.slow
def test_large_plans_take_seconds(tmp_path):
    """The largest real print has 44 000 contours; a quarter of that must not take a minute."""
    large = document(11_000, 20)
    started = time.perf_counter()
    write_plan(large, tmp_path / "plan.json")
    again = read_plan(tmp_path / "plan.json")
    assert time.perf_counter() - started < 30.0
    assert len(again.contours) == 11_000


ODD = (
    None,
    True,
    -1,
    0,
    2**70,
    10**4000,
    1e308,
    1e5,
    "x" * 10**5,
    "",
    "x",
    [],
    [[]],
    {},
    {"a": 1},
    [1, "a"],
    [None],
    0.5,
)


def places(value: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a nested value."""
    keys = value if isinstance(value, dict) else range(len(value))
    own = [(value, key) for key in keys]
    deeper = [
        p for _, key in own if isinstance(value[key], dict | list) for p in places(value[key])
    ]
    return own + deeper


@pytest.mark.slow
def test_random_damage_is_an_input_error_or_harmless(written, tmp_path):
    """Whatever stands in the file, the answer is a plan or one line, never a traceback."""
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(500):
        plan = copy.deepcopy(written)
        spots = places(plan)
        container, key = spots[rng.integers(len(spots))]
        container[key] = ODD[rng.integers(len(ODD))]
        try:
            write_and_read(plan, tmp_path)
        except InputError:
            refused += 1
    assert refused > 300
