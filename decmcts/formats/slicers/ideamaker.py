"""ideaMaker."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={"ideaMaker": "ideaMaker"},
    roles={
        Role.EXTERNAL_PERIMETER: ("wall-outer",),
        Role.PERIMETER: ("wall-inner",),
        Role.INFILL: ("fill",),
        Role.SOLID_INFILL: ("solid-fill",),
        Role.BRIDGE_INFILL: ("bridge",),
        Role.SKIRT_BRIM: ("skirt", "raft"),
        Role.SUPPORT: ("support",),
    },
    layers=(r"LAYER:\s*-?\d+$",),
    values={"PRINTING": "mesh"},
    times=("PRINTING_TIME", "REMAINING_TIME"),
)
