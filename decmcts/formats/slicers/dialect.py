"""The form of what is known of a slicer's files.

What a file says is read by the words of all slicers together (`known.every`): files are edited
by scripts and by hand, so nothing depends on who wrote one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from decmcts.print.contours import Role


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """The words of one slicer, or of a family that shares them.

    Comments are given without their marks. Patterns are regular expressions that ignore case.
    """

    signs: Mapping[str, str] = field(default_factory=dict)  # by which it names itself, before its
    # version: as they stand in a file -> the name that is shown
    roles: Mapping[Role, tuple[str, ...]] = field(default_factory=dict)  # what beads are for, in
    # lower case
    layers: tuple[str, ...] = ()  # patterns of comments that begin a layer
    notes: tuple[str, ...] = ()  # patterns of comments that belong to the layer marker above them
    values: Mapping[str, str] = field(default_factory=dict)  # `KEY: value`: key -> what it states,
    # of "width", "height" (of beads), "layer" (a note), "mesh"
    objects: tuple[str, ...] = ()  # how comments begin that open a label, in lower case,
    objects_end: tuple[str, ...] = ()  # and that close it
    numbered: tuple[str, ...] = ()  # how those of both begin that stand beside others of a name
    changes: tuple[str, ...] = ()  # how comments begin above a slicer's own change of tools,
    changes_end: tuple[str, ...] = ()  # and below it
    times: tuple[str, ...] = ()  # patterns of what stands before a time in a comment,
    time_words: tuple[str, ...] = ()  # and words that "time" follows there, blanks included

    layer_time: tuple[str, ...] = ()  # settings: layers are slowed down to this, s,
    slows: tuple[str, ...] = ()  # and whether they are, 1 or 0
    folded_layer_time: tuple[str, ...] = ()  # the former in settings that are folded into lines,
    folds: tuple[str, ...] = ()  # and patterns of what begins each further line
    bare_inside: tuple[str, ...] = ()  # settings: travels within the part stay unretracted, 1
    max_feed: tuple[str, ...] = ()  # how settings of the axes' largest feeds begin

    radius: tuple[str, ...] = ()  # settings of the head's clearances: of its radius,
    rod: tuple[str, ...] = ()  # of the height from which on all is taken,
    bed: tuple[str, ...] = ()  # and of the bed's corners
    printers: Mapping[str, str] = field(default_factory=dict)  # pattern of `printer_model` ->
    # preset with the maker's own shapes; the longer ones first
