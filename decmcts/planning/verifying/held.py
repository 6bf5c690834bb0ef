"""The rules a plan is held to when it is judged again."""

from __future__ import annotations

from dataclasses import dataclass, replace

from decmcts.arguments import check_fields
from decmcts.planning.options import Freedom, ProcessOrder, refuse_too_many_ahead
from decmcts.print.plan import OrderRules


@dataclass(frozen=True, slots=True)
class Held:
    """The rules a plan is held to; None: as the plan states.

    Parameters
    ----------
    process_order, quality, max_layers_ahead, freedom, min_layer_time_s
        As in `decmcts.Rules`.

    Raises
    ------
    InputError
        For a limit below zero or beyond what plan.json holds, or a name that is none.

    Examples
    --------
    >>> from decmcts import Held
    >>> Held(quality=True).names()
    ['quality']
    """

    process_order: ProcessOrder | None = None
    quality: bool | None = None
    max_layers_ahead: int | None = None
    freedom: Freedom | None = None
    min_layer_time_s: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        refuse_too_many_ahead(self.max_layers_ahead)

    def names(self) -> list[str]:
        """Return the names of the rules that are not None."""
        return [name for name in self.__slots__ if getattr(self, name) is not None]

    @property
    def any_rule(self) -> bool:
        """Whether any of them is a rule of the order; the layer time is not."""
        return bool(set(self.names()) - {"min_layer_time_s"})

    def over(self, rules: OrderRules) -> OrderRules:
        """Return `rules` with those that are not None here in their place."""
        order, freedom, ahead = self.process_order, self.freedom, self.max_layers_ahead
        return replace(
            rules,
            process_order=rules.process_order if order is None else order.value,
            quality=rules.quality if self.quality is None else self.quality,
            max_layers_ahead=rules.max_layers_ahead if ahead is None else ahead,
            freedom=rules.freedom if freedom is None else freedom.value,
        )


AS_STATED = Held()
