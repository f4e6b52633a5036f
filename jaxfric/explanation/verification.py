"""What a selected term removes: alone, on a held-out recording, and from which size on."""

import numpy as np

from ..terms.base import AbstractTerm
from ..terms.effects import traits
from .baseline import as_given
from .evidence import Evidence
from .predictions import with_predictions
from .problem import LEAST_SHARE
from .regression import Fit, fast, without
from .selection import Selection
from .trials import Contest


def residual(
    current: Fit,
    evidence: Evidence,
    rephased: frozenset[int] = frozenset(),
    skipped: frozenset[int] = frozenset(),
) -> np.ndarray:
    """What a fit leaves of a recording with nothing refitted, N, `(J,)`.

    `skipped`: numbers of terms that are left out; `rephased`: numbers of terms whose waves keep
    their amplitude but find their phase anew: the zero of an incremental encoder is another after
    each homing, and that of the clock in each recording.
    """
    return _there(current, evidence, rephased, skipped)[0]


def _there(
    current: Fit, evidence: Evidence, rephased: frozenset[int], skipped: frozenset[int]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """The [`residual`][] on a recording, and the affine parameters of each term there."""
    seen = with_predictions(evidence, current)
    rest, waves, alphas = evidence.target.copy(), [], list(current.alphas)
    for number, (term, beta, alpha) in enumerate(
        zip(current.terms, current.betas, current.alphas, strict=True)
    ):
        if number in skipped:
            continue
        columns = seen.columns(term, beta[None])[0]
        if number in rephased:
            waves.append((number, columns))
        else:
            rest -= columns @ alpha
    for number, columns in waves:
        alpha = np.array(alphas[number])
        for i in range(0, len(alpha), 2):
            free = np.linalg.lstsq(columns[:, i : i + 2], rest, rcond=None)[0]
            size = np.hypot(*alpha[i : i + 2]) / max(float(np.hypot(*free)), 1e-300)
            alpha[i : i + 2] = free * size
            rest = rest - columns[:, i : i + 2] @ alpha[i : i + 2]
        alphas[number] = alpha
    return rest, alphas


def at_phase(current: Fit, evidence: Evidence, rephased: frozenset[int]) -> Fit:
    """A fit with the waves of those numbers at their phase on another recording."""
    return current._replace(alphas=tuple(_there(current, evidence, rephased, frozenset())[1]))


def wavelike(current: Fit, number: int) -> bool:
    """Whether a term is a wave over position, whose phase belongs to the encoder's zero."""
    term = current.terms[number]
    paired = bool(term.affine) and all(p.name.endswith(("_sin", "_cos")) for p in term.affine)
    return paired and "position" in term.coordinates


def lasting(current: Fit, rephased: frozenset[int] = frozenset()) -> Fit:
    """A fit without the terms that say nothing of another recording; only its terms and β count."""
    return current.only(
        [i for i, t in enumerate(current.terms) if i not in rephased and not traits(t).momentary]
    )


def error(current: Fit, evidence: Evidence, rephased: frozenset[int] = frozenset()) -> float:
    """norm(force − predicted)/norm(force) over the rows, nothing refitted.

    Found terms that time alone drives count where they return, and not where they do not; tones may
    return at another phase.
    """
    power = min(float(rest @ rest) for rest, _, _ in _ways(current, evidence, rephased))
    return float(np.sqrt(power / max(evidence.force @ evidence.force, 1e-300)))


def carried(current: Fit, evidence: Evidence, rephased: frozenset[int] = frozenset()) -> Fit:
    """A fit as it stands on another recording, by the way in which [`error`][] is taken there.

    Without what belongs to a moment that does not return, waves at their phase there; what else
    it holds is still of the recording that it was fitted to.
    """
    ways = _ways(current, evidence, rephased)
    _, other, skipped = min(ways, key=lambda way: float(way[0] @ way[0]))
    return (
        other.only([i for i in range(len(current.terms)) if i not in skipped]) if skipped else other
    )


# So many durations before a recording every ramp is over that began then: it takes a quarter of
# the other recording at most.
LONG_AGO = 1e3


def changed_before(current: Fit, evidence: Evidence) -> Fit | None:
    """A fit whose changes at a moment are over when another recording begins; `None` without any.

    What has been picked up, or has worn, may still be so in a recording of later.
    """
    dates = [traits(term).moment if i else "" for i, term in enumerate(current.terms)]
    if not any(dates):
        return None
    before = evidence.limits.start - LONG_AGO * evidence.limits.duration
    betas = list(current.betas)
    for i, (term, date) in enumerate(zip(current.terms, dates, strict=True)):
        own = np.array([p.name == date for p in term.nonlinear], bool)
        betas[i] = np.where(own, before, betas[i]) if date else betas[i]
    return current._replace(betas=tuple(betas))


def _ways(current: Fit, evidence: Evidence, rephased: frozenset[int]):
    """Residual, fit there and terms left out, for each way in which moments may return."""
    moments = frozenset(i for i, t in enumerate(current.terms) if i and traits(t).momentary)
    ways = [(current, rephased, frozenset[int]())]
    if moments:
        ways.append((current, rephased, moments))
    if tones := _tones(current):
        ways.append((current, rephased | tones, moments - tones))
    if (later := changed_before(current, evidence)) is not None:
        ways.append((later, rephased, frozenset(i for i in moments if not _is_dated(current, i))))
    found = []
    for some, anew, skipped in ways:
        rest, alphas = _there(some, evidence, anew, skipped)
        found.append((rest, some._replace(alphas=tuple(alphas)), skipped))
    return found


def _is_dated(current: Fit, number: int) -> bool:
    return bool(traits(current.terms[number]).moment)


def lacking(selection: Selection, evidence: Evidence, number: int) -> Fit:
    """The model refitted without the found term of that number; a base as given stays."""
    less = without(selection.last, evidence, selection.term_index(number))
    if selection.given is None:
        return less
    return as_given(selection.given, less, evidence, selection.free)


def share(
    less: Fit, more: Fit, base: Fit, evidence: Evidence, rephased: frozenset[int] = frozenset()
) -> float:
    """Part of the base's mean-square residual elsewhere that `more` removes beyond `less`."""
    rest, right = residuals(less, more, (evidence, evidence), rephased)
    power = float(np.sum(residual(base, evidence) ** 2))
    return float(np.sum(rest**2) - np.sum(right**2)) / power


def part(current: Fit, evidence: Evidence, number: int) -> float:
    """The force of the term of that number on another recording, in parts of all force there, both
    root mean square.
    """
    seen = with_predictions(evidence, current)
    columns = seen.columns(current.terms[number], current.betas[number][None])[0]
    force = columns @ current.alphas[number]
    return float(np.linalg.norm(force)) / max(float(np.linalg.norm(seen.force)), 1e-300)


def nearer(more: np.ndarray, less: np.ndarray, part: float = 1.0) -> bool:
    """Whether the residual of `more` is smaller than that of `less`, or than a part of its energy,
    N, both `(J,)`.

    Both are cut off at four standard deviations, by the median: isolated events of a recording say
    nothing about a term.
    """
    limit = 4 * np.median(np.abs(more)) / 0.6745
    ours, theirs = (np.minimum(np.abs(r), limit) for r in (more, less))
    return bool(part * np.sum(theirs**2) > np.sum(ours**2))


def residuals(
    less: Fit, more: Fit, rows: tuple[Evidence, Evidence], rephased: frozenset[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of two fits, each on its rows of another recording, with nothing refitted.

    Terms of a moment are left out unless they return there, tones at any phase, but for what tells
    the two apart.
    """
    others = frozenset(
        next(i for i, term in enumerate(less.terms) if term is more.terms[n])
        for n in rephased
        if any(term is more.terms[n] for term in less.terms)
    )
    shared = {id(t) for t in less.terms[1:] if any(t is m for m in more.terms)}
    idle = [
        frozenset(i for i, t in enumerate(current.terms) if id(t) in shared and traits(t).momentary)
        for current in (less, more)
    ]

    def pair(skipped, anew, fits=(less, more)) -> tuple[np.ndarray, np.ndarray]:
        return (
            residual(fits[0], rows[0], others | anew[0], skipped[0]),
            residual(fits[1], rows[1], rephased | anew[1], skipped[1]),
        )

    none = [frozenset[int]()] * 2
    tones = [_tones(current) & same for current, same in zip((less, more), idle, strict=True)]
    ways = [(idle, none)]
    if idle[1]:
        ways.append((none, none))
    if tones[1]:
        others_idle = [same - own for same, own in zip(idle, tones, strict=True)]
        ways.append((others_idle, tones))
    pairs = [pair(*way) for way in ways]
    dated = [
        frozenset(i for i in same if _is_dated(current, i))
        for current, same in zip((less, more), idle, strict=True)
    ]
    if dated[1] and len(dated[0]) == len(dated[1]):
        later = [changed_before(current, rows[0]) for current in (less, more)]
        pairs.append(pair([same - own for same, own in zip(idle, dated, strict=True)], none, later))
    return min(pairs, key=lambda both: both[1] @ both[1])


def _tones(current: Fit) -> frozenset[int]:
    """Numbers of the found terms that are tones in time."""
    known = enumerate(current.terms)
    return frozenset(i for i, t in known if i and _is_tone(t))


def _is_tone(term: AbstractTerm) -> bool:
    waves = traits(term).waves(term)
    return waves is not None and waves.coordinate == "time"


def noise(current: Fit, reference: np.ndarray) -> float:
    """The part of the force error that no model could remove, by [`fast`][]."""
    return fast(current) / float(np.sqrt(np.mean(reference**2)))


def smallest_visible(contest: Contest, current: Fit) -> dict[str, float]:
    """The smallest force, N rms in slip, of each effect that would have been found, by effect.

    A term is selected if its R² is above that of the highest of all draws and above
    `LEAST_SHARE`; the least of an effect's laws counts, and of its shapes nine of ten. Of an effect
    one of whose laws this motion does not show there is no such size.
    """
    level = float(np.sqrt(current.energy / len(current.residual)))
    found: dict[str, float] = {}
    for trial in contest.trials:
        least = max(LEAST_SHARE, trial.threshold)
        if not np.isfinite(least) or trial.effect.name in contest.unseen:
            continue
        size = level * np.sqrt(least) / max(trial.new_part, 1e-3)
        name = trial.effect.name
        found[name] = min(size, found.get(name, np.inf))
    return found
