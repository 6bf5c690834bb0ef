"""Cura."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={"Cura_SteamEngine": "Cura"},
    roles={
        Role.EXTERNAL_PERIMETER: ("wall-outer",),
        Role.PERIMETER: ("wall-inner",),
        Role.INFILL: ("fill",),
        Role.SOLID_INFILL: ("skin",),
        Role.SKIRT_BRIM: ("skirt",),
        Role.SUPPORT: ("support",),
        Role.SUPPORT_INTERFACE: ("support-interface",),
        Role.WIPE_TOWER: ("prime-tower",),
    },
    layers=(r"LAYER:\s*-?\d+$",),
    values={"MESH": "mesh"},
    times=("TIME", "TIME_ELAPSED", r"PRINT\.TIME"),
    folded_layer_time=("cool_min_layer_time",),
    folds=(r"\r?\n;SETTING_3 ",),
)
