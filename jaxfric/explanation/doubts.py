"""What no axis does: inertia or friction that drives it, a force that has nothing to do with it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import terms as laws
from ..checks import NO_STRIBECK, Remark, is_bump
from ..identification.uncertainty import Estimate
from ..terms.base import AbstractTerm, summands
from ..units import VELOCITY, spell
from .evidence import Evidence
from .intervals import spread
from .mismatch import SURE
from .nodes import NODES
from .problem import LINEARITY, Problem
from .quantities import quantity, rise
from .regression import Fit

# A remark by which the baseline is what is reported.
NOT_BETTER = "not_better"
# One by which nothing at reversals was judged.
CREEPS = "creeps"
# More than half of the force's power: the model is further from the force than no force at all is
# from what it leaves.
UNDESCRIBED = 0.5


def drives(current: Fit, evidence: Evidence, block: np.ndarray) -> bool:
    """Whether friction drives the axis instead of braking it, beyond its interval.

    Half the difference of the mean friction forward and backward, by the speeds that were seen:
    a constant load, which terms that know the direction take up, cancels. The slower and the
    faster half each count, since a line through both may be negative where nothing moved.
    """
    index = friction_of(current.terms)
    if not index:
        return False
    known = spread(current, block)
    speed = np.abs(np.asarray(evidence.motion.velocity)[evidence.centre])
    slow = speed <= np.median(speed)
    alpha = np.concatenate(current.alphas)
    for half in (slow, ~slow):
        forward, backward = half & (evidence.side > 0), half & (evidence.side < 0)
        if not (forward.any() and backward.any()):
            continue
        weights = np.zeros(len(known.covariance))
        columns = current.columns[:, index]
        weights[index] = (columns[forward].mean(axis=0) - columns[backward].mean(axis=0)) / 2
        # What is not visible may be anything.
        if weights[: len(alpha)] @ alpha < -known.half_widths(weights[None])[0]:
            return True
    return False


def friction_of(terms: Sequence[AbstractTerm]) -> list[int]:
    """Indices, among all affine parameters, of friction as a function of velocity alone."""
    index, start = list[int](), 0
    leaves = (leaf for term in terms for leaf in summands(term))
    for leaf in leaves:
        if leaf.coordinates == {"velocity"}:
            index += range(start, start + len(leaf.affine))
        start += len(leaf.affine)
    return index


def accelerates(parameters: dict[str, Estimate]) -> bool:
    """Whether the inertia is negative beyond its interval."""
    inertia = parameters.get("inertia")
    if inertia is None or not np.isfinite(inertia.standard_error):
        return False
    return bool(inertia.interval()[1] < 0)


def falling(parameters: dict[str, Estimate], evidence: Evidence) -> str:
    """That a bump of the baseline's curve is negative for sure, and larger than what a sensor
    resolves; empty where none is.

    The curve has taken up another force then, and nothing is left to be named.
    """
    found = [
        f"{name} {quantity(each)}"
        for name, each in parameters.items()
        if is_bump(name)
        and float(each.value) + SURE * float(each.standard_error) < 0
        and -float(each.value) > LINEARITY * evidence.peak
    ]
    if not found or _corrects(evidence):
        return ""
    return (
        f"The baseline as fitted has its bump upside down: {' and '.join(found)}. Friction falls "
        f"towards zero speed then, instead of rising. {NO_STRIBECK} So does a drag that falls "
        "again at speed, as of an eddy-current brake. The other values are beside it."
    )


def _corrects(evidence: Evidence) -> bool:
    """Whether the parameters correct another simulator's values, and so may be negative."""
    return laws.KNOWN_FORCE in evidence.motion.channels


def undescribed(error: float) -> bool:
    """Whether a filtered force error leaves most of the force's power, or is no number."""
    return not error**2 <= UNDESCRIBED


def contradicted(problem: Problem, parameters: dict[str, Estimate]) -> Remark | None:
    """What makes force and motion of a recording contradict each other; `None` if nothing does.

    **Arguments:** `parameters`, of the base, with their errors.
    """
    power = max(float(problem.evidence.force @ problem.evidence.force), 1e-300)
    left = float(np.sqrt(problem.base.energy / power))
    if undescribed(left):
        return _late(problem, left)
    if _corrects(problem.evidence):
        return None
    inertia = parameters.get("inertia")
    unseen = inertia is None or not np.isfinite(inertia.standard_error)
    negative = unseen or accelerates(parameters)
    if negative and drives(problem.base, problem.evidence, problem.block):
        return Remark(
            "wrong_sign",
            "The force drives the axis where it should brake it, and brakes it where it should "
            "accelerate it: force and motion are counted in opposite directions. Turn one of them "
            "round (--scale force=-1).",
            True,
        )
    return None


def _late(problem: Problem, left: float) -> Remark | None:
    """A force that belongs to another moment of the motion than it is written beside."""
    found = apart(problem.evidence)
    if found is None:
        return None
    time, error = found
    which = "late" if time > 0 else "early"
    return Remark(
        "late_force",
        f"The force stands {abs(time):.2g} s too {which} beside the motion: as it is, a plain axis "
        f"leaves {left:.0%} of it, and {error:.0%} where it is taken {abs(time):.2g} s "
        f"{'earlier' if time > 0 else 'later'}. Put both logs on one clock.",
        True,
    )


def apart(evidence: Evidence) -> tuple[float, float] | None:
    """By how much force and motion are apart, s, and the force error where they are together.

    Up to an eighth of the record is tried either way. The shift has to make a passive axis, inertia
    and friction, of what was none: less than half of the force's power is left, and less than half
    of what was left before.
    """
    matrix, count = _plain_axis(evidence), evidence.nodes
    most = count // 8
    force = np.asarray(evidence.motion.force)[:count]
    pads = evidence.motion.num_samples - count

    def rest(shift: int) -> tuple[float, bool]:
        """Power that is left of a force taken `shift` nodes later, in parts of its own."""
        there = evidence.centre + shift
        inside = (there >= NODES) & (there < count - NODES)
        moved = np.pad(np.roll(force, -shift), (0, pads), mode="edge")
        target = evidence.project(moved)[inside]
        basis, triangle = np.linalg.qr(matrix[inside])
        part = basis.T @ target
        inertia, coulomb, viscous, _ = np.linalg.lstsq(triangle, part, rcond=None)[0]
        # Columns of one size: friction by both of its terms.
        passive = bool(inertia > 0 and coulomb + viscous > 0)
        return 1 - float(part @ part) / max(float(target @ target), 1e-300), passive

    before = rest(0)[0]
    tried = {shift: rest(shift) for shift in range(-most, most + 1)}
    able = {shift: power for shift, (power, passive) in tried.items() if passive}
    if not able:
        return None
    best = min(able, key=lambda shift: able[shift])
    if able[best] > min(UNDESCRIBED, UNDESCRIBED * before) or best == 0:
        return None
    spacing = float(np.median(np.diff(evidence.elapsed[:count])))
    return best * spacing, float(np.sqrt(max(able[best], 0.0)))


def _plain_axis(evidence: Evidence) -> np.ndarray:
    """Inertia, Coulomb and viscous friction and a constant, columns of one size, `(J, 4)`."""
    terms = (laws.Inertia(), laws.Coulomb(), laws.Viscous(), laws.Offset())
    columns = [evidence.columns(term, np.zeros((1, 0)))[0, :, 0] for term in terms]
    matrix = np.stack(columns, axis=1)
    return matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)


def doubts(
    current: Fit, problem: Problem, parameters: dict[str, Estimate], error: float
) -> list[Remark]:
    """What makes the model that is reported impossible for an axis.

    **Arguments:** `current`, its fit, on the rows of `problem`; `parameters` of its base, with all
    their errors; `error`: its filtered force error.
    """
    remarks = []
    wrong = ["inertia"] * accelerates(parameters)
    wrong += ["friction"] * drives(current, problem.evidence, problem.block)
    if wrong and not _corrects(problem.evidence):
        remarks.append(
            Remark(
                "not_passive",
                f"{' and '.join(wrong).capitalize()} negative beyond the interval, as on no axis: "
                "is the sign of force or motion wrong, the wrong column taken, or force and motion "
                "written at different times?",
                True,
            )
        )
    if text := falling(parameters, problem.evidence):
        remarks.append(Remark("no_stribeck", text, False))
    if undescribed(error):
        remarks.append(
            Remark(
                "not_described",
                f"{_most(error)} of the force's power has nothing to do with the motion by this "
                "model: is it the right column and the right axis, is the sensor alive, and are "
                "force and motion on one clock?",
                True,
            )
        )
    return remarks


def _most(error: float) -> str:
    return f"{error**2:.0%}" if np.isfinite(error) and error < 1 else "All"


def not_better(gone: tuple[str, ...], before: Any, spoilt: Any, named: bool = False) -> Remark:
    """That findings went since the model with them is worse than the baseline.

    `before`, `spoilt`: the [`Errors`][jaxfric.explanation.improvement] of both; `named`: whether
    what went is told with its sizes.
    """
    names = " and ".join(name.replace("_", " ") for name in gone)
    figures = {
        "here": "the force error",
        "held": "the force error on the held-out recording",
        "filtered": "the filtered force error",
        "filtered_held": "the filtered force error on the held-out recording",
    }
    which = spoilt.worse(before, 0.0)
    changes = [
        f"{figures[name]} from {rise(getattr(before, name), getattr(spoilt, name))}"
        for name in which[:2]
    ] or ["the force error up over the samples in which it moves"]
    return Remark(
        NOT_BETTER,
        f"The structure that was seen has the shape of {names}, but with that the model is worse: "
        f"it takes {' and '.join(changes)}. It is {'not' if named else 'neither named nor'} saved.",
        False,
    )


def creeping(problem: Problem) -> Remark:
    """That reversals were left out, since the axis creeps through them."""
    motion = problem.evidence.motion
    slowest = Estimate(problem.evidence.limits.slowest, 0.0, spell(VELOCITY, motion.unit_names))
    return Remark(
        CREEPS,
        "The axis moves while its friction reverses, as with a friction that is steep about zero "
        f"velocity: below {quantity(slowest)} it is not told from a jump. So reversals were left "
        "out, and presliding, backlash or compliance that shows at reversals alone is not seen.",
        False,
    )
