"""Machine files: what is read, and that each mistake is named."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_dict import machine_from_dict, machine_to_dict
from decmcts.formats.machines.machine_file import (
    load_machine,
    preset_for_printer,
    preset_names,
)
from decmcts.print.machine import Idle, Practice

GOOD = """
name = "mine"
bed = { min = [0, 0], max = [200, 200] }
[[heads]]
name = "a"
[[heads.slices]]
height = 0
polygons = [[[-5, -5], [5, -5], [5, 5], [-5, 5]]]
[[heads.slices]]
height = 8
polygons = [[[-20, -20], [20, -20], [20, 20], [-20, 20]]]
"""


def read(folder: Path, text: str):
    file = folder / "machine.toml"
    file.write_text(text)
    return load_machine(str(file))


def refused(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as error:
        read(folder, text)
    assert "machine.toml" in str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_sound_and_name_their_source(name):
    """A preset that cannot be loaded, or of unknown origin, is of no use to anyone."""
    machine = load_machine(name)
    assert machine.name == name
    assert machine.source
    for head in machine.heads:
        assert [s.height_mm for s in head.slices] == sorted({s.height_mm for s in head.slices})


def test_the_issue_names_these_presets():
    """Users and benchmarks call the machines by these names."""
    wanted = "paper mk3s mk4 mk4s mini xl coreone coreonel ht90 dual-gantry"
    wanted += " dueling-zero rail-3 rail-4 rail-5 rail-6 rail-7 rail-8"
    wanted += " ender3 voron24-300 voron24-350 x1c p1s a1"
    assert set(wanted.split()) <= set(preset_names())


def test_paper_head_is_the_box_of_the_literature():
    """Figures of the paper are compared on this head: a 14 mm box at height 0."""
    (only,) = load_machine("paper").heads[0].slices
    assert only.height_mm == 0.0
    assert only.polygons[0].tolist() == [[-7, -7], [7, -7], [7, 7], [-7, 7]]


def test_preset_names_are_found_in_any_case():
    """People write MK4S as it stands on the printer."""
    assert load_machine("MK4S").name == "mk4s"


@pytest.mark.parametrize("name", preset_names())
def test_machines_survive_the_way_through_a_mapping(name):
    """plan.json carries the machine; one that changed on the way would be checked wrongly."""
    machine = load_machine(name)
    written = machine_to_dict(machine)
    again = machine_from_dict(json.loads(json.dumps(written)))
    assert machine_to_dict(again) == written
    assert again.limits == machine.limits
    assert (again.rails, again.release) == (machine.rails, machine.release)
    assert [head.limits for head in again.heads] == [head.limits for head in machine.heads]


@pytest.mark.parametrize("name", ["dual-gantry", "dueling-zero", "rail-3"])
def test_slices_cover_the_bodies(name):
    """A body outside the slices could touch printed material unseen by the graph."""
    for head in load_machine(name).heads:
        for body in head.bodies:
            low, high = np.array(body.minimum), np.array(body.maximum)
            assert any(
                s.height_mm <= low[2]
                and (p.min(axis=0) <= low[:2]).all()
                and (p.max(axis=0) >= high[:2]).all()
                for s in head.slices
                for p in s.polygons
            )


def test_dual_gantry_rail_keeps_the_bodies_apart_at_any_height():
    """Heads at the rail's separation must not touch, whatever their Y and Z."""
    machine = load_machine("dual-gantry")
    left, right = machine.heads
    widest = max(b.maximum[0] for b in left.bodies) - min(b.minimum[0] for b in right.bodies)
    (rail,) = machine.rails
    assert rail.separation_mm >= widest + machine.head_clearance_mm


def test_dual_gantry_parks_are_out_of_the_others_way():
    """A parked head must not keep the other from any place it reaches."""
    machine = load_machine("dual-gantry")
    left, right = machine.heads
    (rail,) = machine.rails
    separation = rail.separation_mm
    assert right.reach_min[0] - left.park[0] > separation
    assert right.park[0] - left.reach_max[0] > separation
    assert left.park[0] < machine.bed_min[0] - 40 and right.park[0] > machine.bed_max[0] + 40


@pytest.mark.parametrize("name", ["dual-gantry", "dueling-zero", "rail-8"])
def test_beams_cover_the_bed_from_everywhere(name):
    """The beam does not move along Y with the nozzle, so its box has room for both."""
    machine = load_machine(name)
    for head in machine.heads:
        beam = next(b for b in head.bodies if b.name == "beam")
        assert head.reach_min[1] + beam.maximum[1] >= machine.bed_max[1]
        assert head.reach_max[1] + beam.minimum[1] <= machine.bed_min[1]


def test_own_toml_is_read(tmp_path):
    """Users describe their own head."""
    machine = read(tmp_path, GOOD)
    assert machine.bed_max == (200.0, 200.0)
    assert [s.height_mm for s in machine.heads[0].slices] == [0.0, 8.0]
    assert not machine.heads[0].slices[0].polygons[0].flags.writeable


def test_slices_are_sorted_by_height(tmp_path):
    """Kernels rely on ascending heights; PrusaSlicer's own file is unsorted."""
    low, high = "height = 0\n", "height = 8\n"
    swapped = GOOD.replace(low, "height = X\n").replace(high, low).replace("height = X\n", high)
    assert [s.height_mm for s in read(tmp_path, swapped).heads[0].slices] == [0.0, 8.0]


def test_unknown_machine_lists_the_known():
    """The one line must be enough to correct a typing error."""
    with pytest.raises(InputError, match=r"'mk4x'.*did you mean 'mk4.?'.*coreone.*xl"):
        load_machine("mk4x")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[5, 5], [-5, 5]",
            "[-4, -4], [-5, 5]",
            r"polygon 1: it is concave at corner 3 \(-4, -4\)",
        ),
        (
            "[[-5, -5], [5, -5], [5, 5], [-5, 5]]",
            "[[-5, -5], [-5, 5], [5, 5], [5, -5]]",
            "clockwise",
        ),
        ("[[-5, -5], [5, -5], [5, 5], [-5, 5]]", "[[-5, -5], [5, -5]]", "2 points"),
        ("[[-5, -5], [5, -5], [5, 5], [-5, 5]]", "[[-5, -5], [5, 5], [5, -5], [-5, 5]]", "crosses"),
        ("[[-5, -5], [5, -5], [5, 5], [-5, 5]]", "[[-5, 0], [0, 0], [5, 0]]", "crosses or touches"),
        ("[5, 5], [-5, 5]", "[5, 5], [5, 5], [-5, 5]", "point 4 repeats point 3"),
        ("[5, 5], [-5, 5]", "[5, nan], [-5, 5]", r"slices\[0\].*polygon 1.*nan"),
        ("[5, 5], [-5, 5]", "[5, inf], [-5, 5]", "finite"),
        ("[5, 5], [-5, 5]", "[5, 5, 5], [-5, 5]", "row 2 has 3 numbers"),
        ("[5, 5], [-5, 5]", '[5, "5"], [-5, 5]', "expected numbers, found '5'"),
        ("[[[-5, -5], [5, -5], [5, 5], [-5, 5]]]", "[]", "no polygon"),
        ("height = 0", "height = 1", "no slice at height 0"),
        ("height = 0", "height = -1", "below 0"),
        ("height = 8", "height = 0", "two slices at height 0"),
        ("height = 8", "hieght = 8", r"hieght: unknown key; known here: height"),
        (
            "[-5, -5], [5, -5], [5, 5], [-5, 5]",
            "[1, 1], [5, 1], [5, 5], [1, 5]",
            "contains the nozz",
        ),
        ("max = [200, 200]", "max = [0, 200]", "bed: min"),
        ("max = [200, 200]", "max = [200]", "row 0 has 1 numbers"),
        ('name = "mine"', 'name = "mine"\nclearance_mm = -1', "clearance_mm: -1 is below 0"),
        ('name = "mine"', 'name = "mine"\nclearance_mm = true', "expected a finite number"),
        ('name = "mine"', "", "name: missing"),
        ('name = "mine"', 'name = "mine"\nlimits = { jirk = 1 }', "limits.jirk: unknown key"),
        ('name = "mine"', 'name = "mine"\nlimits = { travel_feed = 0 }', "0 would never arrive"),
        (
            'name = "mine"',
            'name = "mine"\nlimits = { acceleration = 1e-300 }',
            "limits.acceleration: 1e-300 would never arrive; 1e-06 is the least",
        ),
        ('name = "a"', 'name = "a"\ntools = [-1]', "tool numbers"),
        ('name = "a"', 'name = "a"\ntools = [0, 99999999999999999999]', "from 0 to 32767"),
        ('name = "a"', 'name = "a"\npace = 0.9', "pace: 0.9 is below 1"),
        ('name = "a"', 'name = "a"\nidle = 3', r"heads\[0\]\.idle: expected a table"),
        ('name = "a"', 'name = "a"\nidle = { after = 3 }', r"idle\.after: unknown key"),
        ('name = "a"', 'name = "a"\nidle = { after_s = 0 }', r"idle\.after_s: 0 is below 1"),
        ('name = "a"', 'name = "a"\nidle = { heat_c_s = 0 }', "heat_c_s: 0 is below 0.01"),
        ('name = "a"', 'name = "a"\nidle = { standby_c = 900 }', "standby_c: expected a finite"),
        ('name = "a"', 'name = "a"\nidle = { retract_mm = 50 }', "retract_mm: expected a finite"),
        ('name = "a"', 'name = "a"\nidle = { prime_mm = -1 }', "prime_mm: -1 is below 0"),
        (
            'name = "a"',
            'name = "a"\npark = [5, 5, -5]',
            r"heads\[0\]\.park: z is -5, below the bed",
        ),
        (
            'name = "a"',
            'name = "a"\nbodies = [{ min = [0, 0, 0], max = [1, 0, 1] }]',
            "not below max",
        ),
    ],
)
def test_mistakes_are_named(tmp_path, old, new, message):
    """A wrong head shape means a crash on the printer: nothing is repaired silently."""
    assert old in GOOD
    line = refused(tmp_path, GOOD.replace(old, new, 1))
    assert re.search(message, line), line


def test_clockwise_polygon_says_which_of_several(tmp_path):
    """Heads have dozens of polygons; the number saves counting."""
    two = GOOD.replace("[[[-20", "[[[0, 0], [1, 0], [1, 1]], [[0, 0], [0, 1], [1, 0]], [[-20")
    assert "heads[0].slices[1] (height 8), polygon 2: it runs clockwise" in refused(tmp_path, two)


def test_syntax_errors_have_their_line(tmp_path):
    """The line number is what an editor jumps to."""
    assert "machine.toml:4:" in refused(tmp_path, GOOD.replace("[[heads]]", "[[heads]", 1))


TWO = (
    GOOD.replace('name = "a"', 'name = "a"\npark = [0, 0, 0]')
    + '[[heads]]\nname = "b"\npark = [90, 0, 0]\nslices = [{ height = 0, polygons = '
    "[[[-5, -5], [5, -5], [5, 5], [-5, 5]]] }]\n"
)
RAIL = '[rail]\naxis = "x"\norder = ["a", "b"]\nseparation_mm = 80\n'


def test_two_heads_on_a_rail_are_read(tmp_path):
    """The good case of the refusals below."""
    assert [rail.order for rail in read(tmp_path, TWO + RAIL).rails] == [("a", "b")]


def test_rails_are_a_list_that_may_be_written_as_one(tmp_path):
    """Planners of one rail must not overlook a second."""
    across = RAIL.replace("[rail]", "[[rails]]")
    along = across.replace('"x"', '"y"').replace("80", "0")
    assert read(tmp_path, TWO + across).rails == read(tmp_path, TWO + RAIL).rails
    both = read(tmp_path, TWO + across + along)
    assert [rail.axis for rail in both.rails] == [0, 1]
    assert read(tmp_path, TWO).rails == ()


def test_a_head_has_its_own_limits_or_the_machines(tmp_path):
    """What a head's limits leave out is as the machine's, which the source may replace."""
    text = "limits = { travel_feed = 99, acceleration = 7 }\n" + TWO
    plain, own = read(
        tmp_path, text.replace('name = "b"', 'name = "b"\nlimits = { jerk = [1, 1, 1, 1] }')
    ).heads
    machine = read(tmp_path, text)
    assert plain.limits is None and machine.limits_of(plain).travel_feed == 99.0
    assert own.limits is not None
    assert (own.limits.travel_feed, own.limits.acceleration, own.limits.jerk[0]) == (99.0, 7.0, 1.0)
    alone = machine.alone(own)
    assert alone.limits == own.limits and alone.heads[0].limits is None


def test_a_head_has_a_pace_of_its_own(tmp_path):
    """Kept in plans; 1 is not written, so older programs read them."""
    plain, slow = read(tmp_path, TWO.replace('name = "b"', 'name = "b"\npace = 1.2')).heads
    assert (plain.pace, slow.pace) == (1.0, 1.2)
    written = machine_to_dict(read(tmp_path, TWO.replace('name = "b"', 'name = "b"\npace = 1.2')))
    assert [head.get("pace") for head in written["heads"]] == [None, 1.2]
    assert machine_from_dict(written).heads[1].pace == 1.2


def test_a_head_says_what_it_does_where_it_stands_idle(tmp_path):
    """Kept in plans; what is left out is the source's, and no head says what is usual."""
    text = TWO.replace('name = "b"', 'name = "b"\nidle = { standby_c = 150, prime_mm = 0 }')
    plain, own = read(tmp_path, text).heads
    assert plain.idle == Idle() and own.idle == Idle(standby_c=150.0, prime_mm=0.0)
    assert own.idle.over(Practice(10.0, 0.3, 180.0)) == Practice(10.0, 0.0, 150.0)
    written = machine_to_dict(read(tmp_path, text))
    assert ["idle" in head for head in written["heads"]] == [False, True]
    assert machine_from_dict(written).heads[1].idle == own.idle


def test_more_heads_than_can_be_planned_are_refused():
    """One line, before anything is planned."""
    machine = load_machine("dual-gantry")
    head = machine.heads[0]
    heads = tuple(replace(head, name=f"h{k}", park=(-100.0 * k - 50, 0, 5)) for k in range(17))
    values = machine_to_dict(replace(machine, heads=heads, rails=()))
    with pytest.raises(InputError, match="17 heads, at most 16 are taken"):
        machine_from_dict(values)


def test_release_is_of_actions_unless_said(tmp_path):
    """Any controller can meet at rest; to signal in motion is a claim about the machine."""
    assert read(tmp_path, TWO).release == "action"
    assert read(tmp_path, 'release = "point"\n' + TWO).release == "point"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TWO.replace('name = "b"', 'name = "a"'), "two heads are named 'a'"),
        (TWO + RAIL.replace('"b"', '"c"'), "no head is named 'c'"),
        (TWO + RAIL.replace("80", "91"), "90 mm apart along x, separation_mm is 91"),
        (TWO + RAIL.replace('["a", "b"]', '["b", "a"]'), "-90 mm apart"),
        (TWO + RAIL.replace('["a", "b"]', '["a", "a"]'), "two or more different heads"),
        (TWO + RAIL.replace('"x"', '"z"'), "rail.axis: expected 'x' or 'y'"),
        (TWO + 2 * RAIL.replace("[rail]", "[[rails]]").replace("80", "91"), "rails[0]: parked"),
        (TWO + RAIL + RAIL.replace("[rail]", "[[rails]]"), "rail: stands beside rails"),
        ('release = "layer"\n' + TWO, "release: expected 'point' or 'action', found 'layer'"),
        (
            TWO.replace('name = "b"', 'name = "b"\nlimits = { max_feed = [0, 1, 1, 1] }'),
            "heads[1].limits.max_feed: 0 would never arrive",
        ),
        (
            TWO.replace("park =", "bodies = [{ min = [-45, 0, 0], max = [45, 9, 9] }]\npark ="),
            "bodies 0 mm apart",
        ),
    ],
)
def test_relations_between_heads_are_checked(tmp_path, text, message):
    """Heads that clash while parked would clash before the first move."""
    assert message in refused(tmp_path, text)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"name = 3\n", b"heads = 1\n"])
def test_files_that_are_no_machine_are_refused(tmp_path, content):
    """Empty, binary and foreign files get a line, not a traceback."""
    file = tmp_path / "machine.toml"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"machine\.toml"):
        load_machine(str(file))


def test_missing_file_is_named(tmp_path):
    """A wrong path is the commonest mistake."""
    with pytest.raises(InputError, match=r"gone.toml: cannot be read"):
        load_machine(str(tmp_path / "gone.toml"))


@pytest.mark.parametrize(
    ("model", "preset"),
    [("MK4S", "mk4s"), ("MK4IS", "mk4"), ("MK3SMMU2S", "mk3s"), ("MINIIS", "mini"), ("XL5", "xl"),
     ("COREONE", "coreone"), ("COREONEL", "coreonel"), ("MK3.9", None), ("X1C", None), ("", None)],
)  # fmt: skip
def test_printer_models_find_their_preset(model, preset):
    """The machine is guessed from the file; a wrong guess would be worse than none."""
    assert preset_for_printer(model) == preset


THREE_LENGTHS = GOOD[: GOOD.index("[[heads.slices]]")] + "clearance = {clearance}\n"


def test_three_lengths_are_a_head(tmp_path):
    """What can be measured with a ruler in a minute is enough to begin with."""
    text = THREE_LENGTHS.replace(
        "{clearance}", "{ radius = 40, nozzle_height = 3, rod_height = 20 }"
    )
    slices = read(tmp_path, text).heads[0].slices
    assert [part.height_mm for part in slices] == [0.0, 3.0, 20.0]
    assert np.abs(slices[1].polygons[0]).max() >= 40.0
    assert np.abs(slices[2].polygons[0]).min() >= 200.0


@pytest.mark.parametrize(
    ("clearance", "word"),
    [
        ("{ radius = 0, rod_height = 20 }", "radius"),
        ("{ radius = 40, rod_height = 2000 }", "rod_height"),
        ("{ radius = 40, rod_height = 20, nozzle_height = 30 }", "nozzle_height"),
        ("{ radius = 40 }", "rod_height"),
        ("{ radius = 40, rod_height = 20, lid = 3 }", "lid"),
        ("{ radius = nan, rod_height = 20 }", "radius"),
    ],
)
def test_lengths_that_cannot_be_are_refused(tmp_path, clearance, word):
    """A typing error here would be proven safe."""
    assert word in refused(tmp_path, THREE_LENGTHS.replace("{clearance}", clearance))


def test_slices_and_clearance_exclude_each_other(tmp_path):
    """Which of the two is the head?"""
    both = GOOD.replace('name = "a"', 'name = "a"\nclearance = { radius = 4, rod_height = 9 }')
    assert "beside slices" in refused(tmp_path, both)
