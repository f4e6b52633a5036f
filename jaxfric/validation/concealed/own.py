"""Effects that are concealed by their own law: drawn within its bounds, added to what is measured.

The default where the simulator has no physics of its own for an effect. The machine moves as it
would without it, and the law's force along that motion is a part of what its force sensor sees.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...data.recording import Recording
from ...models import Model
from ...terms.actuator import PREDICTED, REACTION
from ...terms.base import AbstractTerm
from ...terms.effect import Effect, inside
from ...terms.friction import Gaussian
from ...terms.sample import Scales
from .nominal import Kind, Nominal, Truth, no_physics, rms, scaled

# Shares of the compact set that nonlinear parameters are drawn from: not at its very ends.
SHARES = (0.15, 0.85)


def by_law(effect: Effect) -> Kind:
    """An effect that acts by one of its laws, drawn at random."""
    kind = Kind(
        functools.partial(_draw, effect),
        _force,
        no_physics,
        lambda truth: ", ".join(name.replace("_", " ") for name in effect.coordinates),
        centred=True,
        planted=not effect.needs - {"position"},
        added=True,
    )
    return kind


def _draw(effect: Effect, rng: np.random.Generator, n: Nominal, size: float) -> Truth:
    with jax.enable_x64(True):
        limits = _scales(n)
        shapes = effect.shapes(limits)
        term = effect.suited(shapes[rng.integers(len(shapes))], Gaussian(), None)[0]
        beta = inside(term, limits, rng.uniform(*SHARES, len(term.nonlinear)))
        term = term.with_beta(jnp.asarray(beta)) if beta.size else term
        sizes = [rms(force) or 1.0 for force in _columns(term, n).T]
        alpha = rng.normal(size=len(sizes)) / sizes
        alpha = np.abs(alpha) if effect.positive else alpha
        truth = {"term": _document(term, alpha), "factor": 1.0}
        factor = scaled(by_law(effect), "factor", truth, n, size)["factor"]
        alpha = factor * alpha
        names = zip((*term.affine, *term.nonlinear), (*alpha, *beta), strict=True)
        return {p.name: float(value) for p, value in names} | {
            "term": _document(term, alpha), "factor": 1.0,
        }  # fmt: skip


def _document(term: AbstractTerm, alpha: np.ndarray) -> dict[str, Any]:
    return Model(term, jnp.asarray(alpha)).to_dict()


def _force(truth: Truth, n: Nominal) -> np.ndarray:
    with jax.enable_x64(True):
        model = Model.from_dict(truth["term"])
        return truth["factor"] * (_columns(model.term, n) @ np.asarray(model.alpha))


def _columns(term: AbstractTerm, n: Nominal) -> np.ndarray:
    """The law's columns along a motion, their momentum differentiated, `(N, p)`."""
    channels = {PREDICTED: jnp.asarray(n.u), REACTION: jnp.asarray(n.mass * n.a)}
    motion = Recording(n.time, n.u, n.x, n.v, channels=channels)
    plain = np.asarray(term.columns(motion), float)
    if not term.inertial:
        return plain
    return plain + np.gradient(np.asarray(term.momentum(motion), float), n.time, axis=0)


def _scales(n: Nominal) -> Scales:
    """What a recording of the motion says about magnitudes."""
    interval = float(np.median(np.diff(n.time)))
    numbers = (1e-2 * n.top, n.top, n.x.min(), n.x.max(), rms(n.u), n.time[0], np.ptp(n.time))
    return Scales(*(jnp.asarray(float(value)) for value in (*numbers, interval, np.abs(n.u).max())))
