"""The slicer's own rule for short layers, as each writes it."""

from __future__ import annotations

import pytest

from decmcts.formats.gcode.reading.habits import min_layer_time

CURA = (
    b';SETTING_3 {"global_quality": "[values]\\\\ncool_min_lay\r\n'
    b';SETTING_3 er_time = 8.5\\\\nspeed_print = 40"}\r\n'
)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        (b"; cooling = 1\n; slowdown_below_layer_time = 15\n", 15.0),
        (b"; cooling = 1\r\n; slowdown_below_layer_time = 15\r\n", 15.0),
        (b"; cooling = 0\n; slowdown_below_layer_time = 15\n", 0.0),
        (b"; cooling = 0,1\n; slowdown_below_layer_time = 30,5\n", 5.0),
        (b"; slow_down_for_layer_cooling = 1,1\n; slow_down_layer_time = 4,6\n", 6.0),
        (b";   adjustSpeedForCooling,1\n;   minSpeedLayerTime,10\n", 10.0),
        (b";   adjustSpeedForCooling,0\n;   minSpeedLayerTime,10\n", 0.0),
        (b"; min_layer_time_s = 10\n", 10.0),
        (CURA, 8.5),
        (b"; slowdown_below_layer_time = never\n", 0.0),
        (b"; slowdown_below_layer_time = 99999\n", 0.0),
        (b"G1 X1\n", 0.0),
    ],
)
def test_rule_of_each_slicer(text: bytes, seconds: float) -> None:
    """Read wrongly it costs waits or warps towers; not read at all is no rule."""
    assert min_layer_time(b"G28\n" + text + b"G1 X0\n") == seconds
