"""Signals that a fit predicts from the motion: what faults of actuator and friction act on."""

import numpy as np

from ..signals import kernel_slope
from ..terms import KNOWN_FORCE, KNOWN_FRICTION
from ..terms.base import summands
from ..terms.effects import traits
from .evaluation import evaluate, sizes
from .evidence import Evidence
from .regression import Fit

# The signals that a fit predicts at the nodes.
PREDICTED = frozenset({"predicted_force", "predicted_reaction", "predicted_acceleration"})


def with_predictions(evidence: Evidence, fit: Fit) -> Evidence:
    """The evidence with the channels that some terms read, at the nodes.

    `predicted_force` û, N (the measured force in its place would explain itself);
    `predicted_reaction`, what of that is no friction, N; `predicted_acceleration`, m/s².
    """
    force, momentum, reaction, moved = np.zeros((4, evidence.motion.num_samples))
    for term, beta, alpha in zip(fit.terms, fit.betas, fit.alphas, strict=True):
        if term.coordinates & PREDICTED:
            continue  # a fault acts on what the motion needs, not on itself
        plain, moving = evaluate(
            term, np.repeat(beta[None], sizes(term)[0], axis=0), evidence.read_by(term)
        )
        borne = alpha * [not own for part in summands(term) for own in part.frictional]
        force = force + alpha @ np.asarray(plain)[0]
        reaction = reaction + borne @ np.asarray(plain)[0]
        if moving is not None:
            momentum = momentum + alpha @ np.asarray(moving)[0]
            moved = moved + borne @ np.asarray(moving)[0]
    force = force + rate(evidence, momentum)
    reaction = reaction + rate(evidence, moved)
    if KNOWN_FORCE in evidence.motion.channels:
        known = np.asarray(evidence.motion.channels[KNOWN_FORCE])
        force = force + known
        reaction = reaction + known - np.asarray(evidence.motion.channels.get(KNOWN_FRICTION, 0.0))
    if any(traits(term).switches for term in fit.terms):
        force = _crossing(force, np.asarray(evidence.motion.force))
    return evidence.with_channels(
        predicted_force=force,
        predicted_reaction=reaction,
        predicted_acceleration=rate(evidence, np.asarray(evidence.motion.velocity)),
    )


def _crossing(force: np.ndarray, command: np.ndarray) -> np.ndarray:
    """A predicted force that passes through zero when its command does.

    Across a dead-band the command jumps, and its sign is beyond doubt; the prediction's is not,
    and a step at the wrong moment would make the band narrower than it is.
    """
    apart = np.sign(force) != np.sign(command)
    return np.where(apart, np.finfo(float).tiny * np.sign(command), force)


def rate(evidence: Evidence, values: np.ndarray) -> np.ndarray:
    """Time derivative of a signal at the nodes, by the kernel of the rows, `(M,)`.

    What the kernel takes off it to second order is put back: of a force that swings within a few
    kernels that is some per cent, which a saturation would show several times.
    """
    half = evidence.half
    spacing, apart = evidence.reach / half, half // 2  # the bend is seen at half the kernel's reach
    tau = np.arange(-half, half + 1) / half
    weight = kernel_slope(tau)
    weight = weight / np.sum(weight * tau * evidence.reach)
    out = np.convolve(values, weight[::-1], "same")
    cubed = np.sum(weight * (tau * evidence.reach) ** 3) / 6
    bend = np.roll(out, -apart) - 2 * out + np.roll(out, apart)
    out = out - cubed * bend / (apart * spacing) ** 2
    # Where the kernel reaches across an interruption, or beyond the ends: the near difference.
    segment, reach = np.asarray(evidence.motion.segment), half + apart
    whole = np.roll(segment, reach) == np.roll(segment, -reach)
    whole[:reach] = whole[-reach:] = False
    near = np.gradient(values, spacing)
    return np.where(whole, out, near)
