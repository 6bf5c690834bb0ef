"""Where a plan saves travel: by layer, and by the length of travels."""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.team.schedule.metrics import path_lengths
from sim.arrays import Floats
from sim.pictures.layer_travels import by_layer, layers_of, most_changed, travels_of

EDGES_MM = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)  # and above


def saving_of(before: PlanDocument, after: PlanDocument) -> dict[str, Any]:
    """Return travel in mm before and after, by layer and by length; and where it changed most."""
    numbers = layers_of(before)[0]
    layers = int(numbers[-1]) + 1 if len(numbers) else 1
    edges = np.array([*EDGES_MM, np.inf])
    by_length: dict[str, Any] = {"edges_mm": list(EDGES_MM)}
    each = [by_layer(travels_of(document), len(numbers)) for document in (before, after)]
    of_layers: dict[str, Any] = {"layer": list(range(layers))}
    for name, document, made in (("before", before, each[0]), ("after", after, each[1])):
        mm = np.zeros(layers)
        mm[numbers] = made
        of_layers[name] = np.round(mm, 1).tolist()
        mm = np.concatenate([np.zeros(0), *map(travel_lengths, document.plan.heads)])
        by_length[name] = np.histogram(mm, edges)[0].tolist()
        by_length[f"{name}_mm"] = np.round(np.histogram(mm, edges, weights=mm)[0], 1).tolist()
    most = int(numbers[most_changed(*each)]) if len(numbers) else 0
    return {"unit": "mm", "by_layer": of_layers, "by_length": by_length, "most_changed": most}


def travel_lengths(actions: HeadActions) -> Floats:
    """Return the length of each action of a head that does not print, mm."""
    return np.asarray(path_lengths(actions)[actions.kind != ActionKind.PRINT])
