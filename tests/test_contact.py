"""What blocks an axis: named as itself, and nothing else taken for it."""

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation.sanity.contact import contacts
from jaxfric.terms import KNOWN_FORCE

TIME = np.arange(8000) * 0.002
INERTIA, COULOMB, GAIN, DAMPING = 0.05, 0.4, 200.0, 5.0


def goal(time, sharp):
    """A sum of sines, or a trapezoidal velocity that turns round within 2 % of the stroke."""
    if sharp:
        phase = (0.5 * time) % 1.0
        return 0.6 * np.interp(
            phase, [0, 0.02, 0.48, 0.52, 0.98, 1], [-1, -0.99, 0.99, 1, -0.98, -1]
        )
    return 0.5 * np.sin(1.3 * time) + 0.2 * np.sin(3.1 * time) + 0.1 * np.sin(5.7 * time)


def driven(stop=None, sharp=False, scale=1.0, stiffness=3000.0):
    """A PD loop's position and force, N, with a stop at a part of the upper end, if any."""
    sub = 10
    dt, rows = 0.002 / sub, []
    wanted = goal(np.arange(len(TIME) * sub) * dt, sharp)
    rate = np.gradient(wanted, dt)
    x, v = wanted[0], rate[0]
    for k in range(len(wanted)):
        force = GAIN * (wanted[k] - x) + DAMPING * (rate[k] - v)
        if k % sub == 0:
            rows.append((x, force))
        depth = 0.0 if stop is None else max(x - stop, 0.0)
        against = stiffness * depth + (20.0 * v if depth else 0.0)
        v += dt * (force - COULOMB * np.tanh(v / 1e-3) - against) / INERTIA
        x += dt * v
    position, force = np.array(rows).T
    return scale * position, force


def log(position, force, known=None):
    rng = np.random.default_rng(0)
    count = np.ptp(position) / 2**16
    position = count * np.round(position / count)
    force = force * (1 + 0.002 * rng.normal(size=len(force)))
    channels = {} if known is None else {KNOWN_FORCE: known}
    return jf.Recording(TIME, force, position, channels=channels)


def needed(position, inertia=INERTIA):
    """The simulator's force along the recorded motion."""
    smooth = np.convolve(
        np.pad(position, 10, "edge"), np.hanning(21) / np.hanning(21).sum(), "valid"
    )
    speed = np.gradient(smooth, TIME)
    return inertia * np.gradient(speed, TIME) + COULOMB * np.tanh(speed / 1e-3)


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_stop_is_found_at_its_place_on_its_side(way, unit):
    position, force = driven(stop=0.45)
    known = needed(position)
    found = contacts(log(way * unit * position, way * force, way * known))
    (contact,) = found
    assert contact.upper == (way > 0)
    place = way * unit * 0.45
    assert abs(contact.place.value - place) < 2 * contact.place.standard_error + 0.01 * unit
    run = log(way * unit * position, way * force, way * known)
    kept = np.asarray(contact.without(run).mask)
    beyond = position > 0.46
    assert not kept[beyond].any() and kept.mean() > 0.7
    assert contact.share > 0.9


def test_a_bumper_on_which_the_axis_stands_is_no_block():
    """It is pressed there by the bumper and by friction that holds it: more than friction alone."""
    wanted = np.interp(
        TIME % 4.0, [0.0, 0.5, 1.5, 2.0, 2.5, 3.5, 4.0], [0.0, 0.5, 0.55, 0.5, 0.0, -0.5, 0.0]
    )
    kernel = np.hanning(301) / np.hanning(301).sum()
    position = np.convolve(np.pad(wanted, 150, "edge"), kernel, "valid")
    position = np.minimum(position, 0.5)  # it stands there for a while
    speed = np.gradient(position, TIME)
    known = INERTIA * np.gradient(speed, TIME) + COULOMB * np.sign(speed)
    bumper = 20.0 * np.maximum(position - 0.4, 0.0)
    standing = (position > 0.4999) & (np.abs(speed) < 1e-3)
    pressed = known + bumper + np.where(standing, COULOMB, 0.0)
    assert (pressed - known)[standing].min() > 2 * COULOMB
    assert not contacts(log(position, pressed, known))
    blocked = known + np.where(standing, 6 * COULOMB, 0.0)
    assert contacts(log(position, blocked, known))


def test_a_place_that_the_axis_passes_at_other_times_blocks_nothing():
    position, _ = driven()
    position = np.concatenate([position, position[::-1]])[::2]  # there twice
    known, place = needed(position), position.max() - 0.02
    excess = np.where(position > place, 300 * (position - place), 0.0)
    (contact,) = contacts(log(position, known + excess, known))
    assert contact.upper and abs(contact.place.value - place) < 0.01
    assert contacts(log(position, known + np.where(TIME < 8, excess, 0.0), known)) == []


@pytest.mark.slow
@pytest.mark.parametrize("sharp", [False, True])
@pytest.mark.parametrize(
    "wrong",
    ["nothing", "inertia", "late", "friction", "spring", "gain", "no inertia"],
)
def test_nothing_else_is_taken_for_a_stop(sharp, wrong):
    position, force = driven(sharp=sharp)
    inertia = {"inertia": 4 * INERTIA, "no inertia": 0.0}.get(wrong, INERTIA)
    known = needed(position, inertia)
    if wrong == "late":
        known = np.roll(known, 25)
    elif wrong == "friction":
        known = known - 0.8 * COULOMB * np.sign(np.gradient(position))
    elif wrong == "spring":
        force = force + 20 * position
    elif wrong == "gain":
        force = 3 * force
    assert contacts(log(position, force, known)) == []


@pytest.mark.slow
def test_an_explanation_names_it_and_nothing_beside_it():
    position, force = driven(stop=0.45)
    told = jf.explain(log(position, force), jf.simulators.Known(needed(position)))
    assert [finding.effect for finding in told.findings] == ["end_stop"]
    assert told.verdict in ("explained", "partly_explained")
    assert "something blocks the axis" in told.findings[0].sentence
    (row,) = [row for row in told.sanity if row["check"] == "end_stop"]
    assert row["wrong"]
