"""A joint's actuator: the force that it makes of a command, and what its own values add to it.

MuJoCo's law (general actuator on a joint, gear g, l = g q): the joint's force is
F = g (k w + b₀ + b₁ l + b₂ dl/dt), w the command u, or what follows it as τ dw/dt = u − w.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.recording import Recording
from ..terms import KNOWN, KNOWN_FEEDBACK
from .inverse import Along
from .known import Attribute

# The channel that holds the command, in the actuator's own unit.
COMMAND = f"{KNOWN}command"
# Time constants after which a filter's start is forgotten to a thousandth: ln 1000.
FORGOTTEN = 7.0

# No effect has quite the shape of its law: of the amplitude so much may be something else.
SHAPE = 0.1
# Of its limit, where dry friction has all but reached it.
AT_LIMIT = 0.999

Parts = tuple[np.ndarray, np.ndarray]


class Actuator(NamedTuple):
    """A joint's only actuator.

    `number` and `name`; `gear` g; `gain` k; `bias` b₀, b₁, b₂; `constant` τ, s, zero where the
    command acts at once; `delay`, s; `control` and `force`: the ranges of command and force;
    `hinge`: whether the joint turns; `ahead`: how much later, s, is the speed that the bias takes
    than that of the positions: an implicit integrator takes that of the step's end, Euler's that of
    its start, and positions tell that of its middle.
    """

    number: int
    name: str
    gear: float
    gain: float
    bias: tuple[float, float, float]
    constant: float
    delay: float
    control: tuple[float, float]
    force: tuple[float, float]
    hinge: bool
    ahead: float = 0.0

    @property
    def servo(self) -> int:
        """Which part of the bias is the gain's own: 1 of a position servo, 2 of a velocity servo,
        whose force is k (u − l) or k (u − dl/dt); else 0.
        """
        ties = [i for i in (1, 2) if self.gain > 0 and np.isclose(self.gain, -self.bias[i])]
        return ties[0] if ties else 0

    @property
    def plain(self) -> bool:
        """Whether it passes the command on: a motor."""
        return not any(self.bias) and not self.constant

    def path(self, what: str) -> str:
        """The name of an attribute: `actuator/shoulder/gear`."""
        return f"actuator/{self.name}/{what}"

    @property
    def gain_name(self) -> str:
        """What says how much force a command makes."""
        if not any(self.bias):
            return "gear"
        return ("gainprm[0]", "kp", "kv")[self.servo]

    @property
    def units(self) -> tuple[str, str, str]:
        """Of the three numbers of the bias."""
        force, place = ("N·m", "rad") if self.hinge else ("N", "m")
        return force, f"{force}/{place}", f"{force}·s/{place}"

    def state(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """The bias as force at the joint, N or N·m, `(N,)`."""
        constant, by_place, by_speed = self.bias
        place, speed = self.gear * position, self.gear * velocity
        return self.gear * (constant + by_place * place + by_speed * speed)


def only(mujoco: Any, model: Any, joint: int) -> int | None:
    """The only actuator that acts on a joint itself; `None` where there is none, or several."""
    kind = int(mujoco.mjtTrn.mjTRN_JOINT)
    own = [
        i
        for i in range(model.nu)
        if int(model.actuator_trntype[i]) == kind and int(model.actuator_trnid[i, 0]) == joint
    ]
    return own[0] if len(own) == 1 else None


def passive(mujoco: Any, model: Any, names: Sequence[str]) -> frozenset[str]:
    """Which of a model's joints, in its order, no actuator drives where it drives others.

    None where an actuator acts on something else than a joint, and may drive any of them; nor of a
    model without actuators, which leaves open what drives it.
    """
    kinds = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
    if not model.nu or not {int(kind) for kind in model.actuator_trntype} <= kinds:
        return frozenset()
    driven = {int(each[0]) for each in model.actuator_trnid}
    return frozenset(name for i, name in enumerate(names) if i not in driven)


def label(model: Any, number: int) -> str:
    """An actuator's name."""
    return model.actuator(number).name or f"actuator{number + 1}"


def read(mujoco: Any, model: Any, joint: int) -> Actuator:
    """The joint's actuator; raises `ValueError` where its law is none of those above."""
    number = only(mujoco, model, joint)
    if number is None:
        raise ValueError("The joint has no actuator, or several, whose command a log could hold.")
    name = label(model, number)
    dynamics, gain, bias = mujoco.mjtDyn, mujoco.mjtGain, mujoco.mjtBias
    filters = int(dynamics.mjDYN_FILTER), int(dynamics.mjDYN_FILTEREXACT)
    kind = int(model.actuator_dyntype[number])
    able = kind in (int(dynamics.mjDYN_NONE), *filters)
    able &= int(model.actuator_gaintype[number]) == int(gain.mjGAIN_FIXED)
    affine = int(model.actuator_biastype[number]) == int(bias.mjBIAS_AFFINE)
    if not able or not (affine or int(model.actuator_biastype[number]) == int(bias.mjBIAS_NONE)):
        raise ValueError(
            f"The actuator {name} makes its force by a law of which only MuJoCo knows (muscle, "
            "integrator, damper, plugin): give the joint's force instead of its command."
        )
    limits = (
        (model.actuator_ctrllimited, model.actuator_ctrlrange),
        (model.actuator_forcelimited, model.actuator_forcerange),
    )
    control, force = (
        tuple(map(float, pair[number])) if on[number] else (-np.inf, np.inf) for on, pair in limits
    )
    schemes, half = mujoco.mjtIntegrator, 0.5 * float(model.opt.timestep)
    taken = {int(schemes.mjINT_EULER): -half, int(schemes.mjINT_RK4): 0.0}
    ahead = taken.get(int(model.opt.integrator), half)
    late = getattr(model, "actuator_delay", np.zeros(model.nu))
    return Actuator(
        number, name, float(model.actuator_gear[number, 0]),
        float(model.actuator_gainprm[number, 0]),
        tuple(float(b) if affine else 0.0 for b in model.actuator_biasprm[number, :3]),
        float(model.actuator_dynprm[number, 0]) if kind in filters else 0.0,
        float(late[number]), control, force,
        int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE),
        ahead,
    )  # fmt: skip


def driven(own: Actuator, recording: Recording, seen: Along, joint: int) -> Recording:
    """The recording with the joint's force that the actuator makes of its force, the command.

    The command stays as the channel `known_command`, what the actuator makes of position and
    velocity as `known_feedback`: the command alone may be late. Where the actuator still remembers
    what was before the recording, nothing is compared.
    """
    command = np.asarray(recording.force, float)
    time = np.asarray(recording.time, float)
    held = _held(np.clip(command, *own.control), time, own.delay)
    acting = _filtered(held, time, own.constant) if own.constant else held
    known = np.isfinite(command) & (time - time[0] >= own.delay + FORGOTTEN * own.constant)
    valid = known & np.asarray(recording.mask)
    bare = dataclasses.replace(recording, velocity=None, channels={})
    own = _timely(own, bare, acting, seen, joint)
    bias = _bias(own, joint, seen)
    force = _made(own, acting, bias)
    kind = np.asarray(recording.time).dtype
    state = {KNOWN_FEEDBACK: jnp.asarray(bias.astype(kind))} if any(own.bias[1:]) else {}
    return dataclasses.replace(
        recording,
        force=jnp.asarray(np.where(np.isfinite(command), force, np.nan).astype(kind)),
        mask=jnp.asarray(valid),
        channels=recording.channels
        | {COMMAND: jnp.asarray(np.nan_to_num(command).astype(kind))}
        | state,
    )


def _made(own: Actuator, acting: np.ndarray, bias: np.ndarray) -> np.ndarray:
    return own.gear * np.clip(own.gain * acting + bias / own.gear, *own.force)


def _timely(
    own: Actuator, recording: Recording, acting: np.ndarray, seen: Along, joint: int
) -> Actuator:
    """The servo with the speed of another moment, from that of now to that which the model's
    integrator takes, where that accounts for most of what the latter leaves: a machine has no
    integrator, another simulator another, or other steps.

    Beside it the command may act a little late, and the fewest of the joint's values are wrong.
    """
    if not own.ahead or not own.bias[2]:
        return own
    rest, later, late, *values = _in_slip(own, recording, acting, seen, joint)

    def tried(some) -> tuple[float, float, float, float]:
        """What is left, at which part of the way to now; at none; and what all of it makes."""
        basis = np.linalg.qr(np.stack([late, *some], axis=1))[0]
        left, column = (x - basis @ (basis.T @ x) for x in (rest, later))
        part = float(left @ column) / max(float(column @ column), 1e-300)
        part = min(max(part, 0.0), 1.0)
        after = float(np.sum((left - part * column) ** 2))
        return after, part, float(left @ left), float(column @ column)

    enough = 2 * tried(values)[0] + SHAPE**2 * tried([])[3]
    for count in range(len(values) + 1):
        left, part, before, _ = min(map(tried, itertools.combinations(values, count)))
        if left <= enough:
            break
    return own._replace(ahead=own.ahead * (1 - part)) if left < 0.5 * before else own


def _in_slip(
    own: Actuator, recording: Recording, acting: np.ndarray, seen: Along, joint: int
) -> list[np.ndarray]:
    """What the made force leaves of the needed one; what of it is the speed's moment, the
    command's lateness, gain, damping, friction, a constant.

    Like an inertia the moment shows by the acceleration, whose noise would hide it: it is moved
    onto a kernel. Each kernel is wholly in slip, where friction is at its limit.
    """
    now = own._replace(ahead=0.0)
    speed, held = seen.motion.velocity[:, joint], _bias(now, joint, seen)
    braked = _bias(now._replace(bias=(0.0, 0.0, own.bias[2])), joint, seen)
    gained = own.gear * own.gain * acting + held - braked
    # Noise of the acceleration is beyond four times the width that tells that of a moment best.
    half = 4 * signals.choose(recording, order=2).half_width + 1
    span = half * float(np.median(np.diff(np.asarray(recording.time, float))))
    at = np.arange(-half, half + 1) / half
    weight, slope = (1 - at**2) ** 4, -8 / span * at * (1 - at**2) ** 3

    def through(values, kernel=weight):
        return np.convolve(values, kernel, "valid")

    later = own.ahead * through(braked, slope)
    needed = through(seen.rest[:, joint]) + through(seen.momentum[:, joint], slope)
    rest = through(_made(own, acting, held)) + later - needed
    way, dry = np.sign(speed), seen.friction[:, joint]
    firm = np.where(way * dry >= AT_LIMIT * np.abs(dry).max(), way, 0.0)
    slips = np.abs(through(firm)) > (1 - 1e-9) * weight.sum()
    columns = map(through, (np.gradient(acting), gained, speed, way, np.ones_like(speed)))
    return [each[slips] for each in (rest, later, *columns)]


def _held(command: np.ndarray, time: np.ndarray, delay: float) -> np.ndarray:
    """The command that acts at each time: the last one that was given, and has arrived."""
    known = np.maximum.accumulate(np.where(np.isfinite(command), np.arange(len(command)), 0))
    last = np.nan_to_num(command[known])
    if not delay:
        return last
    return last[np.maximum(np.searchsorted(time, time - delay, side="right") - 1, 0)]


def _filtered(values: np.ndarray, time: np.ndarray, constant: float) -> np.ndarray:
    """What follows values that are held from sample to sample, τ dw/dt = u − w, exactly."""
    rest = np.exp(-np.diff(time) / constant)
    found = np.empty_like(values)
    found[0] = state = values[0]
    for i, (kept, value) in enumerate(zip(rest.tolist(), values[:-1].tolist(), strict=True), 1):
        found[i] = state = value + kept * (state - value)
    return found


def _smooth(values: np.ndarray, time: np.ndarray, constant: float) -> np.ndarray:
    """The same of values that are straight between samples: the mean of both neighbours acts."""
    middle = np.append(0.5 * (values[1:] + values[:-1]), values[-1])
    return _filtered(middle, time, constant)


Made = Mapping[str, tuple[Attribute, Callable[[Along], Parts]]]


def columns(own: Actuator, joint: int, sprung: Attribute | None) -> Made:
    """The actuator's bias with its columns: by how much the force that it makes of the recorded
    command is larger than the joint's. `sprung`: where the joint's spring rests, if it has one.
    """
    owner = f"actuator {own.name}"
    tied = {own.servo} - {0}
    free = [i for i in range(3) if i not in tied] if any(own.bias) else [0]
    found = {}
    for i in free:
        braking = i == 2 and own.servo == 1
        what, value = ("kv", -own.bias[i]) if braking else (f"biasprm[{i}]", own.bias[i])
        alike = (sprung,) if sprung and i == 0 else ()
        attribute = Attribute(owner, what, value, own.units[i], alike)
        found[own.path(what)] = attribute, _by_bias(own, joint, i, 1.0 if braking else -1.0)
    return found


def _by_bias(own: Actuator, joint: int, number: int, sign: float) -> Callable[[Along], Parts]:
    one = own._replace(bias=tuple(float(i == number) for i in range(3)), ahead=0.0)

    def parts(seen: Along) -> Parts:
        force = sign * _bias(one, joint, seen)
        return force, np.zeros_like(force)

    return parts


def gain(own: Actuator) -> Attribute:
    """The value that says how much force a command makes."""
    if own.gain_name == "gear":
        return Attribute(f"actuator {own.name}", "gear", own.gear, "1")
    unit = own.units[own.servo]
    return Attribute(f"actuator {own.name}", own.gain_name, own.gain, unit)


def by_gain(own: Actuator, joint: int, seen: Along) -> Parts:
    """The force that the gain makes, as the model needs it: without the bias that is not its."""
    others = tuple(0.0 if i == own.servo and i else b for i, b in enumerate(own.bias))
    bias = _bias(own._replace(bias=others), joint, seen)
    return seen.rest[:, joint] - bias, seen.momentum[:, joint]


def by_constant(own: Actuator, joint: int, seen: Along, time: np.ndarray) -> Parts:
    """By the filter's τ: what it has not passed on yet of the force that the command makes, by τ.

    Exact for any change: (1 + τ's)/(1 + τs) − 1 = (τ' − τ) s/(1 + τs).
    """
    parts = seen.rest[:, joint] - _bias(own, joint, seen), seen.momentum[:, joint]
    rest, momentum = ((each - _smooth(each, time, own.constant)) / own.constant for each in parts)
    return rest, momentum


def constant(own: Actuator) -> Attribute:
    """The time constant of the actuator's filter."""
    return Attribute(f"actuator {own.name}", "dynprm[0]", own.constant, "s")


def _bias(own: Actuator, joint: int, seen: Along) -> np.ndarray:
    position, velocity, acceleration = (each[:, joint] for each in seen.motion)
    return own.state(position, velocity + own.ahead * acceleration)


def standing(mujoco: Any, model: Any, joint: int, commanded: Actuator | None) -> list[str]:
    """What of a joint's actuator a log tells, and what it does not, in words."""
    name = model.joint(joint).name or f"joint{joint + 1}"
    if commanded is not None:
        made = f"what the model's actuator {commanded.name} makes of the recorded command"
        return [f"The joint's force is {made}."]
    try:
        own = read(mujoco, model, joint)
    except ValueError:
        return []
    if own.plain:
        return []
    return [
        f"The log holds the joint's force: bias and time constant of its actuator {own.name} stand "
        f"before that force, and are not told. Its command would tell them: --columns "
        f"{name}_command=NAME."
    ]
