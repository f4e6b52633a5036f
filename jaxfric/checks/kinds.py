"""The faults that are looked for: names, severity, and the sentence with the remedy."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np


class Kind(NamedTuple):
    """A fault: its name, whether results beside it are certain to be wrong, and its sentence.

    In the sentence `{value}` is the number found, `{size}` the same without its sign, `{sooner}`
    says "earlier", or "later" where it is negative, `{force}` and `{position}` are the units,
    `{at}` is the number of the kind `NAME_at`. A kind without a sentence is such a number.
    """

    name: str
    severe: bool
    text: str


class Remark(NamedTuple):
    """A named sentence about a recording or a result.

    `severe`: what is said beside it is certain to be wrong.
    """

    name: str
    text: str
    severe: bool

    def to_dict(self) -> dict[str, Any]:
        """The remark as plain data."""
        return self._asdict()


KINDS = (
    Kind(
        "velocity_sign",
        True,
        "The velocity column has the opposite sign of the position's derivative. Give "
        "--scale velocity=-1 (or position=-1, if the force has the velocity's sign).",
    ),
    Kind(
        "velocity_scale",
        True,
        "The position moves {value:.4g} times as fast as the velocity column says, so the two are "
        "in different units{guess}. Give --scale velocity={factor:.6g}, or leave the column out: "
        "--columns velocity= . If the position's unit is the wrong one: --scale "
        "position={inverse:.6g}.",
    ),
    Kind(
        "time_scale",
        True,
        "The position moves {value:.4g} times as fast as the velocity column says, with samples "
        "further apart than a drive's: the time is not in s{guess}. Give --scale "
        "time={value:.4g}.",
    ),
    Kind(
        "force_is_velocity",
        True,
        "The force column is the position's derivative, within {value:.1%}, and the velocity "
        "column is not: they are exchanged. Name each by the other's column: --columns "
        "force=NAME,velocity=NAME.",
    ),
    Kind(
        "velocity_gain",
        False,
        "The position moves {value:.4g} times as fast as the velocity column says: the scale of "
        "one of the two, the clock or a filter is off by that, and so may be the inertia, viscous "
        "friction and Stribeck velocity, whose intervals hold both. Leave the velocity out "
        "(--columns velocity=) to use the position.",
    ),
    Kind(
        "velocity_unrelated",
        True,
        "The velocity column is not the derivative of the position: they share {value:.0%} of "
        "their power. A column of another axis, or swapped? Name the right ones with --columns.",
    ),
    Kind(
        "velocity_late",
        False,
        "The velocity column is {value:.3g} s late beside the position, as by a filter or a cycle, "
        "so that friction would change its sign at the wrong time. The position corrects it.",
    ),
    Kind(
        "velocity_smoothed",
        False,
        "Where the axis turns, the velocity column is off by {value:.2%} of the top speed, as by a "
        "filter, and the position knows it better. It is derived from the position instead. "
        "To keep the column, leave the position out: --columns position= .",
    ),
    Kind(
        "velocity_shifted",
        False,
        "The velocity column is {value:.3g} s late beside the position (early, if negative), so "
        "that friction changes its sign at the wrong time. Leave it out: --columns velocity= .",
    ),
    Kind(
        "force_constant",
        True,
        "The force column holds {value:.0f} different values only: it is no measurement of this "
        "motion. Name another column: --columns force=NAME.",
    ),
    Kind(
        "force_is_motion",
        True,
        "The force column is the position or the velocity times a constant, within {value:.1%}: no "
        "drive's force is. Name the force's own column: --columns force=NAME.",
    ),
    Kind(
        "position_is_reference",
        True,
        "The position equals the reference in every sample: it is the set-point, not what the axis "
        "did. Name the measured column: --columns position=NAME.",
    ),
    Kind(
        "no_motion",
        True,
        "The position shows no motion beyond its noise, so that there is no speed to tell forces "
        "by. Is it the column of an axis that moved?",
    ),
    Kind(
        "broken_clock",
        False,
        "The time stamps break the recording into {value:.0f} pieces, too short to filter: stamps "
        "of arrival in packets, or lost samples. Log the drive's own clock.",
    ),
    Kind(
        "one_speed",
        False,
        "The axis moves at one speed only, within {value:.0%}: friction at that speed is all that "
        "can be seen, neither its slope nor the inertia. Move at several speeds.",
    ),
    Kind(
        "force_frozen",
        False,
        "The force keeps one value for {value:.0%} of the recording while the axis moves: the "
        "sensor or the log stood still. Empty these cells, which masks them.",
    ),
    Kind(
        "force_held",
        False,
        "The force keeps each value for {value:.0f} samples: it is logged at a slower rate than "
        "the motion, and late by half of that. Log both at one rate, or the motion at the force's.",
    ),
    Kind(
        "force_interpolated",
        False,
        "The force is straight over {value:.0f} samples at a time: logged at a slower rate and "
        "drawn finer afterwards, so that there is nothing to filter between two samples. Give the "
        "log at its own rate.",
    ),
    Kind(
        "force_filler",
        False,
        "The force is exactly {value:.10g} again and again, with a jump before and after: a number "
        "written where none was measured. Empty these cells, which masks them.",
    ),
    Kind(
        "force_wraps",
        False,
        "At {value:.0f} samples the force jumps across its whole range in full motion and goes on "
        "from the other end: its numbers overflow. Log it with more bits.",
    ),
    Kind(
        "force_levels",
        False,
        "The force column holds {value:.0f} different values only, so that it is known to a good "
        "part of its range at best. Log it with more digits.",
    ),
    Kind(
        "force_clipped",
        False,
        "In {value:.0%} of the samples the force stays at the end of its range: a clipped signal, "
        "unless the drive was at its limit. Widen the range of the log, or leave these samples out "
        "(an empty cell masks one).",
    ),
    Kind(
        "force_spikes",
        False,
        "The force of lone samples ({value:.0f} of them) is far beyond all others: made by the "
        "sensor or the file. Empty these cells, which masks them.",
    ),
    Kind(
        "position_spikes",
        False,
        "The position jumps to and fro at lone samples ({value:.0f} of them), as no motion does. "
        "Empty these cells, which masks them.",
    ),
    Kind(
        "velocity_spikes",
        False,
        "The velocity column jumps to and fro at lone samples ({value:.0f} of them), as no motion "
        "does. Empty these cells, which masks them, or leave the column out: --columns velocity= .",
    ),
    Kind(
        "one_direction",
        False,
        "One of the two directions has {value:.1%} of the slip, so that its friction is an "
        "extrapolation. Move both ways.",
    ),
    Kind(
        "coarse_sampling",
        False,
        "The position changes faster than its samples resolve (few of them a cycle, or stamps that "
        "jitter): the velocity from it is off by some "
        "{value:.1%} of its size. Log faster, or log the drive's velocity.",
    ),
    Kind(
        "clock_jitter",
        False,
        "The position scatters from sample to sample by its velocity times {value:.3g} s, at all "
        "speeds alike: the samples were not taken at the times of their stamps. What a model "
        "leaves grows with the speed for that, and is no friction. Log the time at which each is "
        "taken.",
    ),
    Kind(
        "few_samples_a_cycle",
        False,
        "The motion has {value:.1f} samples a cycle, so that friction and inertia are averaged "
        "together. Log faster, sixteen samples a cycle at least.",
    ),
    Kind(
        "velocity_noise",
        False,
        "The noise of the position leaves {value:.1%} of error in the velocity. Move faster, or "
        "log a finer position or the drive's velocity.",
    ),
    Kind(
        "magnitude",
        False,
        "The axis moves at {value:.3g} {position}/s, faster than any drive: the position is in "
        "another unit than {position}, or the time is. Give --scale or --units.",
    ),
    Kind(
        "force_is_acceleration",
        False,
        "The force is the acceleration times a constant, within {value:.1%}: either the axis has "
        "next to no friction, or the column is no force.",
    ),
    Kind(
        "few_rows",
        False,
        "Between the reversals only {value:.0f} stretches are long enough to filter, too few to "
        "check the fit by: few samples a stroke, or a short recording. Log faster or longer.",
    ),
    Kind(
        "force_late",
        False,
        "Taken {size:.3g} s {sooner}, the force leaves half as much beyond the noise: force and "
        "motion were logged with different delays, or one of them through a filter. The intervals "
        "hold, to first order, what that makes of the parameters. Shift one of them; jaxfric "
        "explain tells more.",
    ),
    Kind(
        "force_stamped",
        False,
        "The force acts {value:.3g} s after its time stamp, as one that is held from sample to "
        "sample does by half of one: a parameter is off by more than a twentieth for that. Take it "
        "into account: --align (in Python align=True).",
    ),
    Kind(
        "gain_by_sign",
        False,
        "With {value:.3g} times as much of its positive part the model fits the force with half "
        "the error: the sensor or amplifier has a gain of its own for each sign.",
    ),
    Kind(
        "friction_by_direction",
        False,
        "Friction differs by direction: with friction of its own for each the error would be "
        "{value:.0%} of what it is. Give --model without symmetric-, in Python "
        "Directional(Coulomb() + Viscous()).",
    ),
    Kind(
        "change_in_the_middle",
        False,
        "Before and after {value:.4g} s the recording obeys different parameters: another machine "
        "or gain, a payload, or an axis that changed. Identify the two parts by themselves.",
    ),
    Kind(
        "negative_parameter",
        False,
        "{value:.0f} of inertia, Coulomb and viscous friction are negative beyond their intervals, "
        "as in no passive axis: the force or the velocity is late, something is missing, or "
        "friction still falls at the fastest speed, where a Stribeck curve has not ended.",
    ),
    Kind(
        "shape_unknown",
        False,
        "{value:.0f} of the widths and velocities that were searched may be anything down to zero, "
        "so that the size that goes with each, and its interval, hold for about the value told: of "
        "a narrower bump the height is another one. Move slowly there, or give --bounds.",
    ),
    Kind(
        "large_error",
        False,
        "The model leaves {value:.0%} of the force, as noise or as something faster than the rows: "
        "a hum, a wrong column? Look at the residual before the parameters are used.",
    ),
    Kind(
        "structure_left",
        False,
        "The model leaves {value:.1%} of the force, and not as noise: something is missing from "
        "it, and the parameters hold a part of that. jaxfric explain says what.",
    ),
    Kind(
        "curve_missed",
        False,
        "The model misses the friction curve by up to {value:.3g} {force}, most at {at:.3g} "
        "{position}/s, and not as noise: its law of velocity is another one than the axis's. The "
        "intervals hold noise and not a wrong law, so that parameters may be off by more. Add what "
        "is curved there (a Stribeck bump, a gradual change of sign at zero speed, a drag that "
        "grows or thins with the speed), or try jaxfric select; jaxfric explain looks for what "
        "fits.",
    ),
    Kind("curve_missed_at", False, ""),
    Kind(
        "force_missed",
        False,
        "What the model leaves follows the force itself, by up to {value:.3g} {force}, most at "
        "{at:.3g} {force}, and not as noise: a dead band of the actuator, a gain of its own for "
        "each sign, or friction that grows with the load. The intervals do not count it, so that "
        "parameters, Coulomb friction above all, may be off by more. jaxfric explain says more.",
    ),
    Kind("force_missed_at", False, ""),
    Kind(
        "excerpt",
        False,
        "The recording is long: sixteen pieces, evenly spread over it, {value:.1%} of its samples, "
        "are fitted. The force error is that of all samples. Cut the file to look at a part.",
    ),
)
NAMES = tuple(kind.name for kind in KINDS)


def none() -> np.ndarray:
    """No remark: a place for each of the [`KINDS`][], NaN, `(W,)`."""
    return np.full(len(KINDS), np.nan)


def places(found: Mapping[str, float]) -> np.ndarray:
    """The numbers found, by name, in the order of the [`KINDS`][], `(W,)`; NaN elsewhere."""
    return np.array([found.get(name, np.nan) for name in NAMES])


# Factors between units that logs mix, as the position's derivative over the velocity column.
_FACTORS = {
    "rpm beside rad": 2 * np.pi / 60,
    "rpm beside deg": 6.0,
    "rpm beside revolutions": 1 / 60,
    "rad/s beside deg": 180 / np.pi,
    "deg/s beside rad": np.pi / 180,
    "rad/s beside revolutions": 1 / (2 * np.pi),
    "revolutions/s beside rad": 2 * np.pi,
    "a thousandth": 1000.0,
    "a thousandfold": 1e-3,
}


# Factors of clocks that are taken for seconds.
_CLOCKS = {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9}


def _guess(name: str, value: float) -> tuple[str, float]:
    """What two units may be, and the factor between them; the value itself where none is near."""
    factors = _CLOCKS if name == "time_scale" else _FACTORS
    near = [(f" ({name}?)", f) for name, f in factors.items() if abs(value / f - 1) < 0.03]
    return near[0] if near else ("", value)


def remarks(values, units: Mapping[str, str]) -> tuple[Remark, ...]:
    """The sentences of one recording's numbers, `(W,)`, the severe ones first."""
    found = []
    numbers = dict(zip(NAMES, map(float, np.asarray(values, float)), strict=True))
    for kind in KINDS:
        value = numbers[kind.name]
        if np.isnan(value) or not kind.text:
            continue
        at = numbers.get(f"{kind.name}_at", np.nan)
        words = {"size": abs(value), "sooner": "later" if value < 0 else "earlier"}
        guess, factor = _guess(kind.name, value)
        words |= {"guess": guess, "factor": factor, "inverse": 1 / factor if factor else np.inf}
        text = kind.text.format(value=value, at=at, **words, **units)
        found.append(Remark(kind.name, text, kind.severe))
    return tuple(sorted(found, key=lambda remark: not remark.severe))
