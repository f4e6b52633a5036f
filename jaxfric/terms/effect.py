"""What is said of an effect: its laws, where it shows, how it is searched for and told."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..data.recording import Recording
from ..units import POSITION, Dimension
from .base import AbstractTerm
from .sample import Scales

FAMILIES = ("values", "friction", "position", "reversals", "actuator", "time", "neighbour")
"""Kinds of effects, in the order in which they are listed."""

# A recording of ones: names and dimensions of an effect's parameters do not depend on it.
ANY = Scales(*[1.0] * len(Scales._fields))

# A frequency times the half-width of the kernel (1 − τ²)⁴, where it passes nothing: the first zero
# of J₄.₅(2πfh). Above it passes 1 % of a force at most.
PASSED = 1.302


class View(NamedTuple):
    """What the search for a term sees of a recording.

    `limits`: its scales, as floats; `reach`: the kernel's half-width, s, of `nodes` local means;
    `speed`: the median in slip, m/s; `acceleration`: 98 % of those at the nodes are below it, m/s²;
    `asymmetry`: the force forwards and that backwards, their sum by their difference, zero where
    the axis goes one way; `turn`: a revolution in the position's unit, zero of what does not turn.
    """

    limits: Scales
    reach: float
    nodes: int
    speed: float
    acceleration: float
    asymmetry: float = 0.0
    turn: float = 0.0

    def with_turns(self, periods: np.ndarray) -> np.ndarray:
        """Periods of parts of the stroke, the longest first, and a revolution and half of one where
        these are shorter: what sits on a motor of many turns is off once in each (an encoder off
        centre), or twice (a resolver of unequal windings, a crank).
        """
        if not 0 < self.turn < periods[-1]:
            return periods
        return np.append(periods, self.turn / np.array([1.0, 2.0]))


class Waves(NamedTuple):
    """A law that is a wave over a coordinate: its grid is the spectral lines of a recording.

    `coordinate`: "position" or "time"; `inverse`: whether the parameter is a period; `factor`: what
    the wave is multiplied by, the name of a channel, or `SIDE`, the direction; `harmonics`.
    """

    coordinate: str
    inverse: bool
    factor: str = ""
    harmonics: int = 1


# The direction of motion, ±1, as the factor of a wave.
SIDE = "side"


class Residual(NamedTuple):
    """What a fit leaves of a recording, row by row.

    `values`, N; `time`, s, and `elapsed`, s, without interruptions; `counts` of the encoder that
    pass from sample to sample, `None` where the position is not counted; `(J,)` each; `reach` of a
    row to either side, s, twice their spacing; `clock` and `run`: time and elapsed time at the
    nodes; `turns`: elapsed times at which the axis reverses, s; `level` of significance; `interval`
    from sample to sample, s; `noise` of the force's samples, N.
    """

    values: np.ndarray
    time: np.ndarray
    elapsed: np.ndarray
    reach: float
    clock: np.ndarray
    run: np.ndarray
    turns: np.ndarray
    level: float
    interval: float = 0.0
    counts: np.ndarray | None = None
    noise: float = 0.0


class Extent(NamedTuple):
    """Magnitudes of a recording that a sentence is measured by.

    `low` and `high`: the range of the position, m; `force`: root mean square, N; `inertia` of the
    axis by the model, kg, not a number where it has none; `peak`: the largest force of either
    sign, N.
    """

    low: float = 0.0
    high: float = float("inf")
    force: float = float("nan")
    inertia: float = float("nan")
    peak: float = float("nan")

    @property
    def stroke(self) -> float:
        """The range of the position, m."""
        return self.high - self.low


class Derived(NamedTuple):
    """A value that follows from a parameter: `of` it, times a `factor`; its `dimension`."""

    of: str
    factor: float
    dimension: Dimension


def inside(term: AbstractTerm, limits: Scales, place: Float[np.ndarray, "... d"]) -> np.ndarray:
    """β at coordinates from 0 to 1 of a term's compact set, `(..., d)`."""
    pairs = [tuple(float(x) for x in p.bounds(limits)) for p in term.nonlinear]
    box = np.array(pairs, float).reshape(-1, 2).T
    ratio = np.array([p.logarithmic for p in term.nonlinear], bool)
    low, high = (np.where(ratio, np.log(np.where(ratio, end, 1.0)), end) for end in box)
    high = np.maximum(high, low + 1e-9 * (1 + np.abs(low)))
    raw = low + place * (high - low)
    return np.where(ratio, np.exp(np.where(ratio, raw, 0.0)), raw)


# Points of a grid over one nonlinear parameter, where nothing finer is needed.
GRID = 24


def even(term: AbstractTerm, view: View, points: int = GRID) -> np.ndarray:
    """All nonlinear parameters together along the diagonal of the compact set, `(G, d)`."""
    count = len(term.nonlinear)
    if not count:
        return np.zeros((1, 0))
    along = (np.arange(points) + 0.5) / points
    return inside(term, view.limits, np.repeat(along[:, None], count, axis=1))


def product(axes) -> np.ndarray:
    """All combinations of values along several axes, `(G, d)`."""
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def scattered(count: int, dimensions: int) -> np.ndarray:
    """Places spread evenly in the unit cube, however many, `(count, d)`.

    An additive recurrence by powers of the root of x^(d+1) = x + 1 (Roberts 2018).
    """
    roots = np.roots([1, *[0] * (dimensions - 1), -1, -1])
    root = max(x.real for x in roots if abs(x.imag) < 1e-9)
    steps = root ** -np.arange(1.0, dimensions + 1)
    return (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0


# Fewer periods in the stroke are no repetition.
REPEATED = 1.5
# Over time, where anything may wander, a wave has repeated once its second period is over.
RECURS = 2.0


def with_parameter(name: str, text: str) -> Callable[[Mapping[str, float], Extent], str | None]:
    """Another sentence, `text`, for a law that has the parameter `name`."""
    return lambda values, extent: text if name in values else None


def _as_it_is(
    term: AbstractTerm, base: AbstractTerm, turn: float | None
) -> tuple[AbstractTerm, ...]:
    return (term,)


def _no_waves(term: AbstractTerm) -> None:
    return None


def _none_recorded(recording: Recording) -> tuple[AbstractTerm, ...]:
    return ()


def _no_dates(term: AbstractTerm) -> dict[str, float]:
    return {}


def _none_derived(values: Mapping[str, float], extent: Extent) -> dict[str, Derived]:
    return {}


def _no_variant(values: Mapping[str, float], extent: Extent) -> None:
    return None


def _nothing(left: Residual) -> Iterator[AbstractTerm]:
    return iter(())


@dataclasses.dataclass(frozen=True)
class Effect:
    """One kind of missing physics: all that the package knows of it.

    What it is:

    - `name`: its public name. `equation`: as displayed to the user. `family`: of [`FAMILIES`][].
    - `laws`: the terms that model it, each a rival of the others. `scaled`: these from the
      [`Scales`][] of a recording (with values, outside jit), where they are not each law as it is;
      none where no term can be tried without looking at the residual. `suited`: what becomes of a
      term for a baseline, and for a position of which `turn` is one revolution (`None`: no angle).

    Where it shows:

    - `coordinates`: those of `jaxfric.explain.locate`, the most telling first.
    - `needs`: signals beside time, velocity and force that a recording must have for `laws`.
    - `recorded`: terms for signals that only this recording has, one for each neighbour, say.
    - `confusable_with`: effects that leave nearly the same trace on an unlucky recording.
    - `separate_by`: the experiment that tells it from these.

    What it is like:

    - `positive`: its affine parameters are magnitudes, so that a fit with another sign is something
      else (friction dissipates, a delay is late, a stop pushes back).
    - `first_order`: its terms are but the first order of the effect, or one law of many.
    - `at_reversals`: it is an idealisation of what happens about a reversal.
    - `momentary`: time alone drives it, so that another recording need not show it.
    - `sharp`: its columns hold a derivative of the acceleration: what the encoder's noise makes of
      that is the noise that the controller answered, which explains force without physics.
    - `delays`: to first order it delays the force, so that force and motion are aligned without it.
    - `leftover`: strong effects leave something of its shape. `local`: at one place, so that it may
      be nearly all that they leave there.
    - `isolated`: it acts at single moments, as what no law describes of a reversal does too.
    - `ubiquitous`: every axis has some of it; what is no larger than the noise is a part of that.
    - `wanders`: it is a smooth curve over time, told by how far that moves over the record.
    - `idealised`: models idealise it; what of it makes no more of the force than noise does is told
      as a part of the baseline.
    - `several`: there may be more than one of it, as of two end stops.
    - `by_parameter`: its terms are of one parameter of the baseline each, and which, is told.
    - `composite`: it acts on every part of the force alike, so that effects of one part each may
      look like it together: they compete with it as a whole.
    - `vanishes`: nonlinear parameters without which there is none of it, a distance or a time.
    - `switches`: its column jumps with the sign of the force, which the command says best.

    How it is searched for:

    - `waves`: of a law that is a wave, over what; `grid`: of another one the β to try, `(G, d)`.
    - `scatter`: further β of a law whose energy has minima between neighbours of such a grid, so
      many of them, `(G, d)`.
    - `outstanding`: laws that the residual itself suggests; `parts`: such a law of some of its
      affine parameters alone, by their numbers, where each is a force by itself.
    - `undone`: the recording with the force where it belongs, for a force that is late by a time,
      s; `also_undone`: the same for other forms of it, which it may be as well; `shift`: the
      parameter by which a prediction takes the force later, if by the whole of it.
    - `logged`: it is in the log alone, and what moves has none of it: a force is recorded late.

    How it is told:

    - `sentence`: with parameters in braces, `{name:size}` without a sign; `variant`: another
      sentence where the name promises more than the values hold. `sizes`: parameters of which only
      the most is known where other terms could stand in for all of it. `moment`: the parameter that
      dates it; `lasting`: that by which it is over again. `dates`: times, s, that a term holds as
      given numbers, by name. `derived`: values that follow from its parameters, by name. `settles`:
      the time constant with which it dies out from the start of the record. `vague`: another
      sentence where its size may be nil with all shapes that it may have, though it acts.

    - `drawn`: whether `prove` conceals it: by physics of its own in the simulator of `prove`, or
      else by its law.
    """

    name: str
    equation: str
    family: str
    sentence: str = ""
    laws: tuple[type[AbstractTerm], ...] = ()
    scaled: Callable[[Scales], tuple[AbstractTerm, ...]] | None = None
    suited: Callable[[Any, AbstractTerm, float | None], tuple[AbstractTerm, ...]] = _as_it_is
    coordinates: tuple[str, ...] = ()
    needs: frozenset[str] = frozenset()
    recorded: Callable[[Recording], tuple[AbstractTerm, ...]] = _none_recorded
    confusable_with: tuple[str, ...] = ()
    separate_by: str = ""
    positive: bool = False
    first_order: bool = False
    at_reversals: bool = False
    momentary: bool = False
    sharp: bool = False
    delays: bool = False
    leftover: bool = False
    local: bool = False
    isolated: bool = False
    ubiquitous: bool = False
    wanders: bool = False
    idealised: bool = False
    several: bool = False
    by_parameter: bool = False
    composite: bool = False
    vanishes: tuple[str, ...] = ()
    switches: bool = False
    waves: Callable[[Any], Waves | None] = _no_waves
    grid: Callable[[Any, View], np.ndarray] = even
    scatter: Callable[[Any, View, int], np.ndarray] | None = None
    outstanding: Callable[[Residual], Iterator[AbstractTerm]] = _nothing
    parts: Callable[[Any, Sequence[int]], AbstractTerm] | None = None
    undone: Callable[[Recording, float], Recording] | None = None
    also_undone: tuple[Callable[[Recording, float], Recording], ...] = ()
    shift: str = ""
    logged: bool = False
    variant: Callable[[Mapping[str, float], Extent], str | None] = _no_variant
    sizes: tuple[str, ...] = ("amplitude",)
    moment: str = ""
    lasting: str = ""
    dates: Callable[[Any], dict[str, float]] = _no_dates
    derived: Callable[[Mapping[str, float], Extent], dict[str, Derived]] = _none_derived
    settles: str = ""
    vague: Callable[[Mapping[str, float], Extent], str | None] = _no_variant
    drawn: bool = True

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise ValueError(
                f"{self.name} is of family {self.family!r}; there are {', '.join(FAMILIES)}."
            )

    def shapes(self, scales: Scales) -> tuple[AbstractTerm, ...]:
        """The terms that model it on a recording of these scales."""
        return tuple(law() for law in self.laws) if self.scaled is None else self.scaled(scales)

    @property
    def late(self) -> bool:
        """Whether the force acts or is recorded late as a whole, and can be put back."""
        return self.undone is not None

    @property
    def periods(self) -> frozenset[str]:
        """The names of its parameters that are periods over the position."""
        every = (p for term in self.shapes(ANY) for p in term.nonlinear)
        return frozenset(p.name for p in every if p.repeats and p.dimension == POSITION)

    @property
    def magnitudes(self) -> frozenset[str]:
        """The names of its parameters that are positive, on a scale of ratios."""
        terms = self.shapes(ANY)
        shapes = {p.name for term in terms for p in term.nonlinear if p.logarithmic}
        sizes = {p.name for term in terms for p in term.affine} if self.positive else set()
        return frozenset(shapes | sizes)
