"""What a head that stands idle does so that it does not ooze.

A head of several waits for others. Its hot end is hot meanwhile, and filament under pressure
seeps out. Slicers know this from changes of tools: the tool that is put down is pulled back
further, and may be cooled to a *standby* temperature; the one that comes is heated, pushed forth
again and primed. What a source does so is its `Practice`, what a machine file says goes before
it. Where neither says anything nothing is done. Where heads stand idle is found in
`decmcts.print.stands`.
"""

from __future__ import annotations

from dataclasses import dataclass

UNLOAD_MM = 20.0  # of filament; who pulls more takes it out of the hot end
IDLE_S = 10.0
HEAT_C_S = 2.0  # 40 W hot ends near 200 °C: they heat faster below


@dataclass(frozen=True, slots=True)
class Practice:
    """What is done with a tool that is not in use."""

    retract_mm: float = 0.0  # filament pulled back in all; no more than for a travel: none further
    prime_mm: float = 0.0  # pushed beyond what was pulled back
    standby_c: float | None = None  # None: it stays as hot as it prints


@dataclass(frozen=True, slots=True)
class Idle:
    """What a machine's file says of a head that stands idle; None: as the source does."""

    after_s: float = IDLE_S  # that it lays nothing, or stands
    standby_c: float | None = None
    heat_c_s: float = HEAT_C_S  # °C/s that its hot end heats by at least
    retract_mm: float | None = None
    prime_mm: float | None = None

    def over(self, source: Practice) -> Practice:
        """Return what the head does, where its source does this.

        Examples
        --------
        >>> Idle(prime_mm=0.0, standby_c=150.0).over(Practice(10.0, 0.3))
        Practice(retract_mm=10.0, prime_mm=0.0, standby_c=150.0)
        """
        return Practice(
            source.retract_mm if self.retract_mm is None else self.retract_mm,
            source.prime_mm if self.prime_mm is None else self.prime_mm,
            source.standby_c if self.standby_c is None else self.standby_c,
        )
