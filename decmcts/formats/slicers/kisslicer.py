"""KISSlicer."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={"KISSlicer": "KISSlicer"},
    roles={
        Role.EXTERNAL_PERIMETER: ("perimeter path",),
        Role.PERIMETER: ("loop path",),
        Role.INFILL: ("sparse infill path", "stacked sparse infill path"),
        Role.SOLID_INFILL: ("solid path", "crown path"),
        Role.BRIDGE_INFILL: ("bridge path",),
        Role.SKIRT_BRIM: ("skirt path", "brim path"),
        Role.SUPPORT: ("support path",),
        Role.SUPPORT_INTERFACE: ("support interface path",),
    },
    layers=("BEGIN_LAYER",),
    times=(r"total estimated \(pre-cool\) minutes",),
    layer_time=("min_layer_time_s",),
)
