"""The experiments by name, and one run of any of them in whatever process."""

from __future__ import annotations

import platform
import time
from collections.abc import Mapping
from importlib.metadata import version
from types import MappingProxyType

from decmcts.errors import InputError, VerificationError
from decmcts.experiments.decentral_or_central import DECENTRAL_OR_CENTRAL
from decmcts.experiments.kinds import Experiment, Key, Row
from decmcts.experiments.loss_and_failure import LOSS_AND_FAILURE
from decmcts.experiments.online import ONLINE
from decmcts.experiments.paper import PAPER
from decmcts.experiments.team_size import TEAM_SIZE
from decmcts.experiments.timing import TIMING
from decmcts.experiments.two_heads import TWO_HEADS
from decmcts.version import __version__

_ALL = (TWO_HEADS, TEAM_SIZE, TIMING, LOSS_AND_FAILURE, DECENTRAL_OR_CENTRAL, ONLINE, PAPER)
EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType({each.name: each for each in _ALL})


def compute(name: str, key: Key) -> Row:
    """Make one run of an experiment and return its row; why it is refused stands in `error`."""
    began = time.process_time()
    try:
        if key["version"] != __version__:
            raise InputError(f"this worker has decmcts {__version__}, not {key['version']}")
        found: Row = EXPERIMENTS[name].run(key)
        error = ""
    except (InputError, VerificationError) as refused:
        found, error = {}, " ".join(str(refused).split())
    asked = {field: value for field, value in key.items() if field != "folder"}
    return {
        **asked, **found, "cpu_s": round(time.process_time() - began, 2),
        "python": platform.python_version(), "numpy": version("numpy"), "numba": version("numba"),
        "error": error,
    }  # fmt: skip
