"""Which touching contours of a layer keep the slicer's order, by their roles.

Process order `keep` holds whatever has different roles. Quality holds what a
slicer would never turn round: the shells of an island (inner and outer
perimeters as sliced), what is anchored in them (infill, bridges, gap fill, top
surfaces after the perimeters they start from), ironing after what it irons, and
contours of which nothing is known. Always, a brim stays before what touches it.
That what lies below comes first needs no rule: material above always blocks the
head.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.graph import EdgeKind
from decmcts.print.contours import Role

SHELLS = (Role.EXTERNAL_PERIMETER, Role.PERIMETER, Role.OVERHANG_PERIMETER)
ANCHORED = (
    Role.INFILL,
    Role.SOLID_INFILL,
    Role.TOP_SOLID_INFILL,
    Role.BRIDGE_INFILL,
    Role.GAP_FILL,
)


def touching_kinds(
    *, process_order: Literal["keep", "free"], quality: bool, brims: bool = False
) -> NDArray[np.uint8]:
    """Return the `EdgeKind` of a contour of role a touching a later one of role b, 0: none.

    Shape (roles, roles), [a, b]. With `brims` a brim stays before what touches it.
    """
    kinds = np.zeros((len(Role), len(Role)), np.uint8)
    if quality:
        for shell in SHELLS:
            kinds[shell, list(SHELLS + ANCHORED)] = EdgeKind.QUALITY
        kinds[:, Role.IRONING] = EdgeKind.QUALITY
        kinds[Role.UNKNOWN, Role.UNKNOWN] = EdgeKind.QUALITY
    if process_order == "keep":
        kinds[~np.eye(len(Role), dtype=np.bool_)] = EdgeKind.PROCESS
    if brims:
        kinds[Role.SKIRT_BRIM, np.arange(len(Role)) != Role.SKIRT_BRIM] = EdgeKind.PRIMING
    return kinds
