"""The verdict: whether findings account for the mismatch, and what is left of it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..checks import LEFT, Remark
from ..terms.effects import EFFECTS
from .acceptance import LINEARITY, OF_BASE
from .finding import Finding
from .significance import LEVEL
from .trials import Contest, Finalist
from .wording import LARGE

# Slow hidden loads of healthy machines make a residual up to about twice as large as its own fast
# part; of four times its size, sixteen times the power, something is missing, wherever.
ROUGH = 4.0
# Where the findings leave half of the mismatch's size, a quarter of its power, less will do: more
# than half as much again as that noise in power. So it will where they leave more than the
# geometric mean of mismatch and noise.
HALF_ROUGH, HALF = 1.25, 0.5


def rough(fit: dict[str, Any], shares: Mapping[str, float]) -> bool:
    """Whether the residual is far above the noise of neighbouring rows, or a large part remains.

    The findings (`shares` by effect) must explain the held-out recording as well: to within four
    times the noise, and its larger part. Effects of time alone need not recur: held-out error is
    allowed in proportion to what they explain here. Without findings a base that has to extrapolate
    may miss that recording by more. No law has quite the shape of its effect: beside findings a
    tenth of the mismatch may remain.
    """
    here, held = fit["force_error"], fit["holdout_force_error"]

    def least(pair) -> float:
        return max(LINEARITY, OF_BASE**0.5 * pair["before"] if shares else 0.0)

    def above(pair, size: float) -> bool:
        return pair["after"] > max(size * fit["noise_floor"], least(pair))

    def remaining(pair) -> float:
        return (pair["after"] / max(pair["before"], 1e-300)) ** 2

    much, far = [here], False
    if held is not None:
        momentary = [share for name, share in shares.items() if EFFECTS[name].momentary]
        excused = HALF_ROUGH**2 * (remaining(here) + sum(momentary)) if momentary else 0.0
        much += [held] if remaining(held) > excused else []
        if not momentary:
            far = above(held, ROUGH)
    # The findings go from the mismatch to the noise, and less than half the way (in decades).
    halfway = np.sqrt(here["before"] * fit["noise_floor"])
    many = any(remaining(pair) > HALF**2 and above(pair, HALF_ROUGH) for pair in much)
    many |= here["after"] > max(halfway, least(here))
    return bool(above(here, ROUGH) or (shares and (many or far)))


def beside_rows(fit: Mapping[str, Any]) -> bool:
    """Whether much of the force is left, sample by sample, that noise does not make.

    The rows hold neither standstill nor what is beside it, and of what is over before a kernel is,
    as the blows of a load in its gap, little. A tenth of the force's power there is not nothing,
    though no row shows it; nor is a tenth of its amplitude, where it has more power than the noise.
    """
    whole, noise = fit["force_error"]["after"] ** 2, fit["noise_floor"] ** 2
    return whole - noise > min(LARGE**2, max(LEFT**2, 0.5 * whole))


def halved(refuted: Sequence[Finding]) -> bool:
    """Whether what the held-out recording refutes halves the size of what the baseline leaves here.

    Noise cannot be removed: then something is missing, though it has another name.
    """
    return any(finding.share > 1 - HALF**2 for finding in refuted)


def halvable(remaining: Contest, made: Callable[[Finalist], bool]) -> bool:
    """Whether a law that was not accepted removes half of what is left, beyond chance, and not what
    was `made` by smoothing.

    Noise cannot be halved, that of the encoder by the controller's answer neither: then something
    is missing, though that law is not its name. Half of what the model leaves that it competed
    beside: what the held-out recording refuted later has removed its part there.
    """
    left = remaining.energy * (1 - HALF)
    halving = [f for f in remaining.finalists if f.p_value <= LEVEL and f.energy < left]
    return not all(made(finalist) for finalist in halving)


# Of two effects that are there each has a part of its own; of three or more that share a quarter of
# what they account for, none can claim it: they stand in for one that the library does not have.
STAND_INS = 3
CLAIMED = 0.75


def stand_ins(alone: list[float], removed: float) -> bool:
    """Whether many findings share what they remove of the mismatch, instead of adding up to it.

    `alone`: what each removes beside all the others.
    """
    return len(alone) >= STAND_INS and overlapping(alone, removed)


def overlapping(alone: list[float], removed: float) -> bool:
    """Whether what each of several findings removes beside the others does not add up to it all."""
    return len(alone) > 1 and sum(max(share, 0.0) for share in alone) < CLAIMED * removed


def verdict_of(
    findings: Sequence[Finding],
    before,
    after,
    rough: bool,
    standing: bool,
    noted: Sequence[Remark],
    dropped: Sequence[str],
) -> str:
    """The verdict, which claims no more than the remarks allow.

    **Arguments:** `before`, `after`: structure that the baseline and the findings leave; `rough`
    and `standing`, by [`rough`][] and [`stand_ins`][]; `noted`: the remarks; `dropped`: effects
    whose findings went as the model with them is worse. Those of single moments are seen of
    healthy machines too: of what no law describes of a reversal.
    """
    verdict = _by_structure(findings, before, after, rough, standing)
    doubtful = any(remark.severe for remark in noted)
    if verdict == "explained" and doubtful:
        return "partly_explained"
    seen = any(name not in EFFECTS or not EFFECTS[name].isolated for name in dropped)
    return "unexplained" if verdict == "consistent" and (doubtful or seen) else verdict


def _by_structure(findings, before, after, rough: bool, standing: bool) -> str:
    if findings:
        return "partly_explained" if after or rough or standing else "explained"
    return "unexplained" if before or rough else "consistent"
