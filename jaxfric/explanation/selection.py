"""What a search selects: terms on top of the base, with what each could be instead."""

from collections.abc import Callable, Hashable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..models import Model
from ..terms.effect import Effect
from .motion import Motion
from .regression import Fit
from .trials import Contest, Finalist, Trial


class SelectedTerm(NamedTuple):
    """A term that was selected, the effects that it may be as well, and its p-value.

    `near`: of those effects the ones that only did as well, with another force, as they competed;
    `rephased`: whether on the held-out recording its waves only fit with another phase;
    `confirmed`: whether that recording confirms it, `None` where it cannot say; `instead`: other
    parameters that may have changed, where the effect is the change of one.
    """

    trial: Trial
    rivals: tuple[str, ...]
    p_value: float
    rephased: bool = False
    confirmed: bool | None = None
    instead: tuple[str, ...] = ()
    near: tuple[Finalist, ...] = ()

    @property
    def effect(self) -> Effect:
        """The effect of the term."""
        return self.trial.effect

    @property
    def form(self) -> Hashable:
        """The form of its law."""
        return self.trial.candidate.form


class Selection(NamedTuple):
    """The terms that the residual calls for, on top of the base.

    - `base` and `last`: the fits before and after.
    - `selected`: in the order of discovery; `remaining`: the contest for what remains.
    - `in_slip`: what rows in slip had shown, where rows reach across reversals.
    - `given`: the base with its own values, where these stay but for `free`, numbers of its
      parameters.
    - `undetermined`: numbers of its parameters that are none, since nothing determines them; all
      others are fitted.
    - `trusted`: whether these values are taken as exact, since a term stands in for wrong ones.
    - `curve`: parameters of the base's friction that are of the samples and not of the rows.
    - `undone`: puts back the force of a recording, where it acts late; `time_error`: of that time,
      by smoothing and sampling, s.
    """

    base: Fit
    last: Fit
    selected: list[SelectedTerm]
    remaining: Contest
    time_error: float = 0.0
    in_slip: "Selection | None" = None
    given: Model | None = None
    free: tuple[int, ...] = ()
    undetermined: tuple[int, ...] = ()
    trusted: bool = False
    curve: Mapping[str, Estimate] = MappingProxyType({})
    undone: Callable[[Recording], Motion] | None = None

    @property
    def fitted(self) -> bool:
        """Whether the base has values of this recording."""
        return self.given is None or bool(self.undetermined)

    @property
    def names(self) -> frozenset[str]:
        """The effects that were found."""
        return frozenset(each.effect.name for each in self.selected)

    @property
    def forms(self) -> frozenset[Hashable]:
        """The forms of the laws that were found."""
        return frozenset(each.form for each in self.selected)

    def at_base(self, base: Fit) -> "Selection":
        """Nothing selected: that fit of the base alone, which may hold what nothing determines of
        it beside findings.
        """
        alone = self._replace(last=base, selected=[])
        return alone._replace(given=None, free=(), undetermined=()) if self.undetermined else alone

    def term_index(self, number: int) -> int:
        """The index, among all terms of the fit, of the selected term of that number."""
        return len(self.last.terms) - len(self.selected) + number

    @property
    def rephased(self) -> frozenset[int]:
        """Indices of the terms that need another phase on the held-out recording."""
        numbers = enumerate(self.selected)
        return frozenset(self.term_index(number) for number, each in numbers if each.rephased)
