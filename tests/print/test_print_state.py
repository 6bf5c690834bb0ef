"""How far a print has come: what events say, and what they cannot say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind, EventLog, PrintEvent
from decmcts.print.print_state import rest_of_line, state_of_events, state_of_layers
from sim.experiments.two_heads import two_heads_plan


@pytest.fixture(scope="module")
def document() -> PlanDocument:
    return two_heads_plan()
