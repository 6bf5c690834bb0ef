"""What is given to public functions is checked before anything is done, and named if wrong."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import GenericAlias
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import decmcts
from decmcts.arguments import check_fields
from decmcts.errors import InputError
from decmcts.formats.bare.qcsp import QcspProblem
from decmcts.formats.mesh.slicers import Slicer
from decmcts.planning.problem.slicing import Chosen

OPTIONS = ("Held", "Rules", "Search", "SliceOptions", "Slicing", "TeamSearch")
NUTS = decmcts.sample_path("four_nuts.gcode.gz")
SOUND = {
    "chosen": Chosen(Slicer.PRUSA, Path("prusa-slicer")), "costs": np.ones((3, 3)),
    "inputs": [NUTS], "name": "paper", "name_or_path": "paper", "path": "none.gcode",
    "precedence": np.zeros((0, 2), np.int32), "problem": object.__new__(QcspProblem),
    "layer": np.zeros(2, int), "machine": "mk4s", "offsets": np.array([0, 2, 4]),
    "points": np.array([[20, 20, 0.2], [40, 20, 0.2], [80, 20, 0.2], [60, 20, 0.2]]),
    "result": NUTS, "self": None, "source": object.__new__(decmcts.Source),
}  # fmt: skip
WORDS = {None: "None", "no such thing": "str", True: "bool"}  # what may be given where it stands
WRONG = (*WORDS, -1, -0.5, math.nan, math.inf, object(), {1: 2}, np.zeros((2, 3, 4)), b"text")


def functions() -> dict[str, Callable[..., Any]]:
    """Return all that a program calls: functions, options, and what writes a result."""
    found = {name: getattr(decmcts, name) for name in dir(decmcts) if name in decmcts.__all__}
    writes = {name: one for name, one in vars(decmcts.Result).items() if name.startswith("write_")}
    return {n: f for n, f in found.items() if inspect.isfunction(f) or n in OPTIONS} | writes


ARGUMENTS = [
    (name, argument)
    for name, function in functions().items()
    for argument in inspect.signature(function).parameters
    if argument != "self"
]


@pytest.mark.parametrize(("name", "argument"), ARGUMENTS)
def test_wrong_arguments_are_named(name: str, argument: str) -> None:
    """An AttributeError from deep inside says nothing of what was given."""
    function = functions()[name]
    parameters = inspect.signature(function).parameters
    given = {one: SOUND[one] for one, p in parameters.items() if p.default is p.empty}
    if name == "bound":
        given["result"] = object.__new__(decmcts.Result)
    for wrong in WRONG:
        fits = isinstance(wrong, str | bool | None) and WORDS[wrong]
        if not fits or fits not in str(parameters[argument].annotation):
            with pytest.raises(decmcts.InputError, match=rf"\b{argument}\b"):
                function(**{**given, argument: wrong})


@pytest.mark.parametrize(
    "call",
    [
        lambda: decmcts.choose_slicer("prusa-sliced"),
        lambda: decmcts.experiment("two-hats"),
        lambda: decmcts.load_machine("mk44s"),
        lambda: decmcts.read("none.gcode"),
        lambda: decmcts.read(NUTS, "mk44s"),
        lambda: decmcts.read(NUTS, "mk4s", plate=2),
        lambda: decmcts.read_qcsp("none.qcsp"),
        lambda: decmcts.read_sop("none.sop"),
        lambda: decmcts.sample_path("none.gcode"),
        lambda: decmcts.simulate([]),
        lambda: decmcts.simulate(["none.gcode"]),
        lambda: decmcts.simulate([NUTS], trials=0),
        lambda: decmcts.simulate([NUTS], queue=0),
        lambda: decmcts.solve_sop(np.ones((2, 3)), np.zeros((0, 2))),
        lambda: decmcts.solve_sop(np.ones((2, 2)), np.array([[0, 2]])),
        lambda: decmcts.verify([]),
        lambda: decmcts.verify(NUTS, "none.gcode"),
        lambda: decmcts.verify(NUTS, NUTS, "mk44s"),
    ],
)
def test_names_of_nothing_are_refused(call: Callable[[], object]) -> None:
    """Right types, wrong values."""
    with pytest.raises(decmcts.InputError):
        call()


class Alias:
    """What `type Alias[T] = ndarray[...]` makes, as Python knows it from 3.12 on."""

    __value__ = np.ndarray[tuple[Any, ...], np.dtype[Any]]
    __class_getitem__ = classmethod(GenericAlias)


STATED: dict[str, Any] = {"a class": NDArray[np.float64], "an alias": Alias[np.float64]}


@pytest.mark.parametrize("hint", list(STATED.values()), ids=list(STATED))
def test_arrays_are_known_as_such_however_numpy_states_them(hint: Any) -> None:
    """numpy 2.5 states them as an alias, on which every plan had ended with an internal error."""

    @dataclass(frozen=True)
    class Option:
        rows: object

        def __post_init__(self) -> None:
            check_fields(self)

    Option.__annotations__["rows"] = hint
    assert np.array_equal(Option([1.0, 2.0]).rows, [1.0, 2.0])
    with pytest.raises(InputError, match="rows is 'abc', must be an array of numbers"):
        Option("abc")
