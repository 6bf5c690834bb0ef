"""Where a plan saves travel: by layer, and by the length of travels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.team.schedule.metrics import path_lengths
from sim.pictures.layer_travels import layers_of, travels_of

EDGES_MM = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)  # and above


def saving_of(before: PlanDocument, after: PlanDocument) -> dict[str, Any]:
    """Return travel in mm before and after, by layer and by length."""
    contours = before.contours
    layers = int(contours.layer.max()) + 1 if len(contours) else 1
    edges = np.array([*EDGES_MM, np.inf])
    by_layer: dict[str, Any] = {"layer": list(range(layers))}
    by_length: dict[str, Any] = {"edges_mm": list(EDGES_MM)}
    for name, document in (("before", before), ("after", after)):
        numbers, travels = layers_of(document)[0], travels_of(document)
        mm = np.bincount(numbers[travels.layer], travels.length_mm, layers)
        by_layer[name] = np.round(mm, 1).tolist()
        mm = np.concatenate([np.zeros(0), *map(travel_lengths, document.plan.heads)])
        by_length[name] = np.histogram(mm, edges)[0].tolist()
        by_length[f"{name}_mm"] = np.round(np.histogram(mm, edges, weights=mm)[0], 1).tolist()
    return {"unit": "mm", "by_layer": by_layer, "by_length": by_length}


def travel_lengths(actions: HeadActions) -> NDArray[np.float64]:
    """Return the length of each action of a head that does not print, mm."""
    return np.asarray(path_lengths(actions)[actions.kind != ActionKind.PRINT])
