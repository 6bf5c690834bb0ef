"""Words of scripts and of slicers that are little known, as their files have them."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={"FullControl": "FullControl"},
    roles={
        Role.EXTERNAL_PERIMETER: ("external-perimeter", "outer shell"),
        Role.PERIMETER: ("inner shell", "shells"),
        Role.INFILL: ("internal-infill",),
        Role.SOLID_INFILL: ("solid fill",),
        Role.TOP_SOLID_INFILL: ("top-fill",),
        Role.GAP_FILL: ("gap-fill",),
        Role.SUPPORT: ("support-material",),
    },
    layers=(r"\*+ LAYER ", r"LAYER \d+"),
)
