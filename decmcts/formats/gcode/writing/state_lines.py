"""The lines that turn one machine state into another; nothing here moves.

A layer may be entered many times. What belongs around its first move is written once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from decmcts.formats.gcode.controller.limits import travel_kinds
from decmcts.formats.gcode.dialects.dialect import LayerWords, layer_words
from decmcts.formats.gcode.document import BEAD, BEFORE_TRAVEL, SILENT, UNSET, GcodeDocument


class StateLines:
    """Keeps the state in force, and writes by `emit` what sets another."""

    def __init__(self, document: GcodeDocument, emit: Callable[[str], None]) -> None:
        self._table, self._emit = document.states, emit
        slots = document.states.slots
        self._written = [k for k, slot in enumerate(slots) if not slot.startswith(SILENT)]
        self._ahead = [k for k in self._written if slots[k] in BEFORE_TRAVEL]
        self._limiting, self._kinds = travel_kinds(document.states)
        self._ranks = [_rank(slot) for slot in slots]
        self._rows: dict[int, list[int]] = {}  # of states
        self._stated: set[tuple[tuple[str, ...], tuple[str, ...]]] = set()  # layer and lines
        self._arrival: tuple[str, ...] = ()  # to be written when the head is there

    def take(self, state: int) -> None:
        """Take a state over from verbatim lines."""
        self._row = self._table.rows[state].tolist()
        self._due_once(layer_words(self._table.text(state, "layer")))

    def set(self, state: int, *, before_travel: bool = False) -> None:
        """Write what sets a state; with `before_travel` only the labels a travel belongs to."""
        table = self._table
        target = self._rows.get(state)
        if target is None:
            target = self._rows[state] = table.rows[state].tolist()
        if not before_travel:
            self._arrive()
        if target == self._row:
            return
        due = self._ahead if before_travel else self._written
        changed = [k for k in due if self._row[k] != target[k]]
        for k in changed:
            if text := table.leave[self._row[k]]:
                self._write(text.split("\n"))
        changed.sort(key=self._ranks.__getitem__)
        for k in changed:
            if table.slots[k] == "layer":
                self._enter(table.values[self._row[k]], table.values[target[k]])
            elif text := table.values[target[k]]:
                self._write(text.split("\n"))
            self._row[k] = target[k]
        if not before_travel:
            self._arrive()

    def set_travel(self, state: int) -> None:
        """Write what limits travels as where the source travels to beads of a state.

        In a state that is of no beads they are limited as by that.
        """
        table, slots = self._table, self._limiting
        lead = -1 if table.travel is None else int(table.travel[state])
        due = {k: int(table.rows[lead if lead >= 0 else state, k]) for k in slots}
        if self._kinds.get(tuple(self._row[k] for k in slots)) == self._kinds[tuple(due.values())]:
            return
        for k, value in due.items():
            if value not in (UNSET, self._row[k]):
                self._write(table.values[value].split("\n"))
                self._row[k] = value

    def _enter(self, held: str, text: str) -> None:
        """Write what begins a layer, and keep what belongs to its first move until that is made."""
        words, had = layer_words(text), layer_words(held).always
        grown = bool(had) and words.always[: len(had)] == had  # the same one, said in part
        self._write(words.always[len(had) if grown else 0 :])
        before, self._arrival = self._due_once(words)
        self._write(before)

    def _due_once(self, words: LayerWords) -> tuple[tuple[str, ...], ...]:
        """Return what is due around the first move of a layer, and take it as written."""
        layer, parts = words.always[:2], (words.before, words.after)
        due = tuple(() if (layer, lines) in self._stated else lines for lines in parts)
        self._stated.update((layer, lines) for lines in parts)
        return due

    def _arrive(self) -> None:
        self._write(self._arrival)
        self._arrival = ()

    def _write(self, lines: Iterable[str]) -> None:
        for line in lines:
            self._emit(line)


def _rank(slot: str) -> int:
    for rank, group in enumerate((BEFORE_TRAVEL, BEAD)):
        if slot in group:
            return 10 * rank + group.index(slot)
    return 100
