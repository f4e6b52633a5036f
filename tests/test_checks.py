"""Faults of recordings and fits: each is found, told with its remedy, and not where it is not."""

import dataclasses
import re

import jax
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric import checks
from jaxfric.checks import KINDS, Design
from jaxfric.identification.identified import result_names

RATE = 1000.0


def log(seed=0, rate=RATE, seconds=12.0, counts=1e5, unit=(1.0, 1.0), velocity=True, noise=0.02):
    """A machine with inertia, Coulomb and viscous friction on a multisine, in any unit."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(rate * seconds)) / rate
    rates = 2 * np.pi * np.array([0.25, 0.7, 1.9])
    phases = rng.uniform(0, 6, 3)
    sizes = np.array([0.05, 0.01, 0.003])
    x = sizes @ np.sin(rates[:, None] * time + phases[:, None])
    v = (sizes * rates) @ np.cos(rates[:, None] * time + phases[:, None])
    a = -(sizes * rates**2) @ np.sin(rates[:, None] * time + phases[:, None])
    force = 3 * a + 8 * np.sign(v) + 40 * v + 8 * noise * rng.normal(size=time.size)
    count = np.ptp(x) / counts
    speed = np.round(v / (np.ptp(v) / 4000)) * np.ptp(v) / 4000 if velocity else None
    f, m = unit
    return jf.Recording(
        time=time,
        force=f * force,
        position=m * np.round(x / count) * count,
        velocity=None if speed is None else m * speed,
    )


def names(recording):
    return [remark.name for remark in checks.inspect(recording)]


def changed(recording, **signals):
    return dataclasses.replace(recording, **signals)


@settings(max_examples=30)
@given(
    st.integers(0, 10**6),
    st.sampled_from([100.0, 250.0, 1000.0, 8000.0]),
    st.floats(4, 6),
    st.tuples(st.floats(-6, 3), st.floats(-4, 1)),
    st.booleans(),
    st.floats(0.001, 0.2),
)
def test_a_healthy_log_has_no_remark(seed, rate, counts, unit, velocity, noise):
    units = 10.0 ** unit[0], 10.0 ** unit[1]
    seconds = 12.0 if rate < 2000 else 6.0
    recording = log(seed, rate, seconds, 10**counts, units, velocity, noise)
    recording = changed(recording, units={"position": "other"})  # of any size
    # A coarse encoder leaves more than half a hundredth of error in the velocity, and that is said.
    assert names(recording) in ([], ["velocity_noise"] if counts < 5 else [])


def test_every_kind_has_a_sentence_with_its_number():
    units = {"force": "N", "position": "m"}
    texts = [remark.text for remark in checks.remarks(np.full(len(KINDS), 2.0), units)]
    assert len(texts) == sum(kind.text != "" for kind in KINDS)
    numbers = {kind.name for kind in KINDS if not kind.text}
    assert numbers <= {f"{kind.name}_at" for kind in KINDS if kind.text}
    assert all("{" not in text and text.rstrip().endswith((".", "?")) for text in texts)
    assert checks.remarks(checks.none(), units) == ()


@pytest.mark.parametrize(
    ("factor", "name", "said"),
    [
        (-1.0, "velocity_sign", "opposite sign"),
        (60 / (2 * np.pi), "velocity_scale", "rpm beside rad"),
        (1000.0, "velocity_scale", "velocity=0.001,"),
        (1.01e-3, "velocity_scale", "velocity=1000,"),
        (180 / np.pi, "velocity_scale", "deg/s beside rad"),
        (0.93, "velocity_gain", "1.075"),
    ],
)
def test_a_velocity_in_another_unit_or_direction(factor, name, said):
    sound = log()
    found = checks.inspect(changed(sound, velocity=factor * sound.velocity))
    assert found[0].name == name and {r.name for r in found} <= {name, "magnitude"}
    assert said in found[0].text
    assert found[0].severe is (name != "velocity_gain")


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.97, 1.01])
def test_a_scale_a_little_off_is_told_and_is_in_the_intervals(factor):
    sound = log()
    off = changed(sound, velocity=factor * sound.velocity)
    (remark,) = checks.inspect(off)
    assert remark.name == "velocity_gain" and f"{1 / factor:.3g}" in remark.text
    true, found = (jf.identify("coulomb-viscous", each).parameters for each in (sound, off))
    for name in ("inertia", "viscous+", "viscous-"):
        low, high = found[name].interval()
        assert low < true[name].value < high, name
    assert found["coulomb+"].standard_error < 1.1 * true["coulomb+"].standard_error


@pytest.mark.slow
@given(tau=st.floats(0.0, 0.03), seed=st.integers(0, 5))
@settings(max_examples=8, deadline=None)
def test_a_filter_is_no_scale(tau, seed):
    sound = log(seed)
    step = float(sound.time[1] - sound.time[0])
    slow, last = [], sound.velocity[0]
    for v in np.asarray(sound.velocity):
        last = last + step / (tau + step) * (v - last)
        slow.append(last)
    assert "velocity_gain" not in names(changed(sound, velocity=np.array(slow)))


@pytest.mark.parametrize(("factor", "clock"), [(1e3, "ms"), (1e6, "µs")])
def test_a_time_that_is_not_in_seconds(factor, clock):
    sound = log()
    (remark,) = checks.inspect(changed(sound, time=factor * sound.time))
    assert remark.name == "time_scale" and remark.severe
    assert f"({clock}?)" in remark.text and f"--scale time={1 / factor:.4g}." in remark.text


def test_force_and_velocity_that_are_exchanged():
    sound = log()
    swapped = changed(sound, force=sound.velocity, velocity=3 * sound.force)
    assert names(swapped)[0] == "force_is_velocity"
    # A copy of the velocity beside the velocity is not exchanged with it.
    assert names(changed(sound, force=sound.velocity)) == ["force_is_motion"]


def test_a_velocity_of_another_axis_and_a_late_one():
    sound, other = log(), log(seed=5)
    assert names(changed(sound, velocity=other.velocity)) == ["velocity_unrelated"]
    speed = np.asarray(sound.velocity)
    late = np.concatenate([np.full(60, speed[0]), speed[:-60]])
    (remark,) = checks.inspect(changed(sound, velocity=late))
    assert remark.name == "velocity_late" and "is 0.06 s late" in remark.text
    early = np.concatenate([speed[60:], np.full(60, speed[-1])])
    (remark,) = checks.inspect(changed(sound, velocity=early))
    assert remark.name == "velocity_shifted" and "-0.05" in remark.text


@pytest.mark.slow
def test_a_velocity_that_is_late_does_not_make_the_friction_wrong():
    sound = log()
    speed = np.asarray(sound.velocity)
    late = changed(sound, velocity=np.concatenate([np.full(8, speed[0]), speed[:-8]]))
    model = jf.models.coulomb_viscous()
    fits = [jf.identify(model, each) for each in (late, sound)]
    np.testing.assert_allclose(fits[0].model.alpha, fits[1].model.alpha, rtol=1e-3)
    assert [r.name for r in fits[0].remarks] == ["velocity_late"]
    both = jf.identify(model, jf.stack([late, sound]))
    np.testing.assert_allclose(both.model.alpha[0], fits[0].model.alpha, rtol=1e-9)
    np.testing.assert_allclose(both.model.alpha[1], fits[1].model.alpha, rtol=1e-9)


@pytest.mark.parametrize("share", [0.5, 0.7, 0.9])
@pytest.mark.parametrize("step", [None, 0.05])
def test_a_clipped_force_is_seen_and_a_rounded_one_is_not(share, step):
    sound = log()
    force = np.asarray(sound.force)
    force = force if step is None else np.round(force / step) * step
    limit = share * np.max(np.abs(force))
    clipped = np.clip(force, -limit, limit)
    (remark,) = checks.inspect(changed(sound, force=clipped))
    assert remark.name == "force_clipped"
    at_limit = np.mean(np.abs(force) >= limit)
    assert f"{at_limit:.0%}" in remark.text or abs(share - 0.9) < 1e-9
    assert names(changed(sound, force=force)) == []


def test_a_force_that_is_no_measurement():
    sound = log()
    moving, count = np.asarray(sound.velocity), sound.num_samples
    cases = {
        "force_constant": np.full(count, 3.3),
        "force_levels": np.sign(moving) * 5 + np.sign(np.gradient(moving)),
        "force_is_motion": 17 * moving,
        "force_frozen": np.where(np.arange(count) > 9000, 4.2, sound.force),
    }
    for name, force in cases.items():
        assert name in names(changed(sound, force=force)), name
    spiked = np.asarray(sound.force).copy()
    spiked[4000] = 1e6
    assert names(changed(sound, force=spiked)) == ["force_spikes"]
    limit = 0.8 * np.max(np.abs(np.asarray(sound.force)))
    overflown = (np.asarray(sound.force) + limit) % (2 * limit) - limit
    assert "force_wraps" in names(changed(sound, force=overflown))


def test_a_position_that_is_no_motion():
    still = log(velocity=False)
    rng = np.random.default_rng(0)
    shaking = changed(still, position=1e-6 * rng.normal(size=still.num_samples))
    assert names(shaking)[0] == "no_motion"
    clamped = changed(still, position=1e-6 * rng.integers(-1, 2, still.num_samples))
    assert names(clamped)[0] == "no_motion"
    jumps = np.asarray(still.position).copy()
    jumps[[3000, 7000]] += 0.02
    assert "position_spikes" in names(changed(still, position=jumps))
    fast = changed(still, position=1e4 * np.asarray(still.position))
    assert "magnitude" in names(fast)


def test_a_recorded_velocity_with_spikes_and_a_motion_one_way():
    sound = log()
    spiked = np.asarray(sound.velocity).copy()
    spiked[[2000, 6000]] *= -4
    assert names(changed(sound, velocity=spiked)) == ["velocity_spikes"]
    forward = np.asarray(sound.velocity) > 0
    assert "one_direction" in names(changed(sound, mask=forward))


def test_few_samples_a_cycle_are_told():
    assert names(log(rate=12.0, seconds=60.0, velocity=False)) == ["coarse_sampling"]
    assert names(log(rate=20.0, seconds=60.0, counts=1e6, velocity=False)) == []


@pytest.mark.parametrize("velocity", [False, True])
def test_samples_that_are_not_taken_when_their_stamps_say(velocity):
    """In either direction: the clock trembles, or what writes its stamps does. Stamps that are
    right, a coarse encoder and one that is white are no jitter.
    """
    steady = np.arange(16000) / RATE
    times = steady + 0.2e-3 * np.random.default_rng(3).uniform(-1, 1, len(steady))

    def taken(at, stamps, noise=0.0, count=1e-7):
        position = 0.2 * np.sin(4 * at) + 0.05 * np.sin(11 * at)
        speed = 0.8 * np.cos(4 * at) + 0.55 * np.cos(11 * at)
        position = position + noise * np.random.default_rng(4).normal(size=len(at))
        force = 2 * np.gradient(speed, steady) + 8 * np.sign(speed) + 5 * speed
        recorded = {"velocity": speed} if velocity else {}
        return jf.Recording(stamps, force, count * np.rint(position / count), **recorded)

    assert "clock_jitter" in names(taken(times, steady))
    assert "clock_jitter" in names(taken(steady, times))
    (told,) = (r for r in checks.inspect(taken(times, steady)) if r.name == "clock_jitter")
    value = float(re.search(r"velocity times (\S+) s,", told.text)[1])
    assert value == pytest.approx(0.2e-3 / np.sqrt(3), rel=0.15)
    for other in (taken(times, times), taken(steady, steady, 1e-5), taken(steady, steady, 0, 1e-4)):
        assert "clock_jitter" not in names(other)


def test_one_speed_and_a_broken_clock():
    time = np.arange(8000) / RATE
    sawtooth = np.abs((time % 2.0) - 1.0) * 0.1
    moves = np.abs((time % 1.0) - 0.5) < 0.45
    force = 5 * np.sign((time % 2.0) - 1.0) + 0.1 * np.random.default_rng(0).normal(size=8000)
    parts = [x[moves] for x in (time, force, sawtooth, time // 1.0)]
    steady = jf.Recording(*parts[:3], segment=parts[3].astype(int))
    assert "one_speed" in names(steady)
    # A few fast moves tell the slope.
    few = parts[0] % 2.0 < 0.1
    faster = dataclasses.replace(steady, position=parts[2] * np.where(few, 20.0, 1.0))
    assert "one_speed" not in names(faster)
    packets = np.repeat(np.arange(800) * 0.01, 10) + np.tile(np.arange(10) * 1e-5, 800)
    broken = jf.Recording(time=packets, force=force, position=sawtooth)
    assert "broken_clock" in names(broken)
    # Samples that are left out are no fault of the clock.
    even = jf.Recording(time=time, force=force, position=sawtooth)
    assert "broken_clock" not in names(changed(even, mask=np.arange(8000) % 40 > 2))
    assert "broken_clock" in names(changed(broken, mask=np.arange(8000) % 400 > 2))


def rows(seed=0, count=800, noise=0.05):
    """A regression of two columns with noise, on rows a hundredth of a second apart."""
    rng = np.random.default_rng(seed)
    time = np.arange(count) * 0.01
    columns = np.stack([np.sign(np.sin(2 * time)), np.sin(2 * time), np.cos(3 * time)], 1)
    return time, columns, noise * rng.normal(size=count)


def fit(columns, target, time):
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    design = Design(columns, target, left, np.ones(len(time)), time, np.zeros(3))
    error = np.linalg.norm(left) / np.linalg.norm(target)
    found = checks.fitted(design, error)
    return {kind.name: v for kind, v in zip(KINDS, found, strict=True) if not np.isnan(v)}


@pytest.mark.parametrize("noise", [0.01, 0.3, 3.0])
def test_noise_alone_is_no_fault_of_a_fit(noise):
    for seed in range(20):
        time, columns, left = rows(seed, noise=noise)
        found = fit(columns, columns @ [5.0, 3.0, 2.0] + left, time)
        assert found.keys() <= ({"large_error"} if noise > 1 else set())


def test_noise_is_no_gain_where_each_direction_has_its_parameters():
    for seed in range(20):
        time, columns, left = rows(seed, noise=0.3)
        forward = columns[:, :1] > 0
        columns = np.where(forward, 1, 0) * columns, np.where(forward, 0, 1) * columns
        columns = np.concatenate([each[:, :2] for each in columns], axis=1)
        force = columns @ [5.0, 3.0, 5.0, 3.0] + left
        # A force of a thousandth less noise, as where rows of another kernel were fitted.
        design = Design(columns, force, 0.999 * left, np.ones(len(time)), time, np.zeros(4))
        assert np.isnan(checks.fitted(design, 0.05)).all()


def test_a_change_in_the_middle_and_a_late_force_are_told_with_their_time():
    time, columns, noise = rows()
    before, after = columns @ [5.0, 3.0, 2.0], columns @ [8.0, 3.0, 2.0]
    moment = 0.7 * time[-1]
    found = fit(columns, np.where(time < moment, before, after) + noise, time)
    assert next(iter(found)) == "change_in_the_middle"
    assert abs(found["change_in_the_middle"] - moment) < 0.06 * time[-1]
    late = np.interp(time - 0.08, time, before) + noise
    found = fit(columns, late, time)
    assert abs(found["force_late"] - 0.08) < 0.02


def test_a_gain_of_its_own_for_each_sign_and_a_short_delay():
    time, columns, noise = rows(noise=0.02)
    force = columns @ [2.0, 3.0, 8.0] + noise
    found = fit(columns, np.where(force > 0, 1.5 * force, force), time)
    assert abs(found["gain_by_sign"] - 1.5) < 0.15  # to first order
    fast = np.cos(20 * time)[:, None]
    late = 8 * np.cos(20 * (time - 0.008)) + noise
    assert abs(fit(fast, late, time)["force_late"] - 0.008) < 0.001


@pytest.mark.slow
def test_friction_that_differs_by_direction_is_no_gain():
    """Beside a model that ties the directions; a gain that the inertia feels too stays one."""
    t = np.arange(16000) / 1000
    rates = 2 * np.pi * np.array([0.25, 0.7, 1.9])[:, None]
    sizes = np.array([0.05, 0.01, 0.003])
    x = sizes @ np.sin(rates * t)
    v = (sizes * rates[:, 0]) @ np.cos(rates * t)
    a = -(sizes * rates[:, 0] ** 2) @ np.sin(rates * t)
    noise = 0.05 * np.random.default_rng(0).normal(size=t.size)

    def said(force):
        run = jf.Recording(t, force + noise, x, v)
        found = jf.identify("symmetric-coulomb-viscous", run)
        return {remark.name for remark in found.remarks}

    differs = np.where(v > 0, 8 + 40 * v, -11 + 75 * v)
    remarks = said(3 * a + differs)
    assert "friction_by_direction" in remarks and "gain_by_sign" not in remarks
    force = 12 * a + np.sign(v) * 8 + 40 * v
    remarks = said(np.where(force > 0, 1.3 * force, force))
    assert "gain_by_sign" in remarks and "friction_by_direction" not in remarks


def test_spikes_are_no_overflow_however_many():
    sound = log()
    force = np.asarray(sound.force).copy()
    at = np.random.default_rng(0).choice(np.arange(10, force.size - 10, 7), 25, replace=False)
    force[at] += 400.0
    (remark,) = checks.inspect(changed(sound, force=force))
    assert remark.name == "force_spikes" and "lone samples (25 of them)" in remark.text
    # Both ways, of three samples each.
    for k, i in enumerate(at):
        force[i : i + 3] = 400.0 * (-1) ** k
    assert "force_wraps" not in names(changed(sound, force=force))


@pytest.mark.slow
def test_a_coefficient_of_either_sign_is_not_called_negative():
    assert [
        n for n in ("inertia", "coulomb+", "viscous_2-", "coulomb_2") if not checks.passive(n)
    ] == []
    others = ("inertia_cos", "inertia_sin", "coulomb_asymmetry", "step_coulomb", "payload_inertia")
    assert not any(map(checks.passive, others))
    rng, sound = np.random.default_rng(0), log()
    x, v = np.asarray(sound.position), np.asarray(sound.velocity)
    varying = jf.terms.PositionDependentInertia(0.06)
    a = np.gradient(v, np.asarray(sound.time))
    own = np.asarray(varying.columns(sound)) @ [0.4, -0.8]
    momentum = np.asarray(varying.momentum(sound)) @ [0.4, -0.8]
    own = own + np.gradient(momentum, np.asarray(sound.time))
    force = 3 * a + 8 * np.sign(v) + 40 * v + own + 0.05 * rng.normal(size=v.size)
    found = jf.identify(
        jf.models.coulomb_viscous() + varying, changed(sound, force=force, position=x)
    )
    assert float(found.parameters["inertia_cos"].interval()[1]) < 0
    assert "negative_parameter" not in {r.name for r in found.remarks}
    assert "as in no passive axis" not in str(found)


def test_a_set_point_is_no_position():
    sound = log()
    twin = changed(sound, channels={"reference": sound.position})
    assert names(twin) == ["position_is_reference"]


def test_structure_is_told_and_noise_is_not():
    time, columns, noise = rows()
    slow = 1.5 * np.sin(0.9 * time + 1)
    assert "structure_left" in fit(columns, columns @ [5.0, 3.0, 2.0] + slow + noise, time)


def result(found):
    return result_names()[int(found.result._value)]


@pytest.mark.slow
def test_what_is_certain_to_be_wrong_is_not_successful():
    sound = log()
    rng = np.random.default_rng(1)
    batch = {
        "successful": sound,
        "not_passive": changed(sound, force=-sound.force),
        "not_described": changed(sound, force=rng.normal(size=sound.num_samples)),
        "contradictory": changed(sound, velocity=1000 * sound.velocity),
    }
    found = jf.identify("coulomb-viscous", jf.stack(list(batch.values())))
    named = [result_names()[int(i)] for i in found.result._value]
    assert named == list(batch)
    assert found.warnings.shape == (4, len(KINDS))
    assert np.isnan(found.warnings[0]).all() and not np.isnan(found.warnings[3]).all()


def real(folder):
    """Recordings of positions, by name: without a recorded velocity where there is one."""
    emps = {"columns": {"time": "t", "position": "qm", "force": "vir", "reference": "qg"}}
    yield jf.read(folder / "emps" / "DATA_EMPS.mat", **emps)
    yield jf.read(folder / "emps" / "DATA_EMPS_PULSES.mat", **emps)
    for path in sorted((folder / "delta_servo").glob("*.csv")):
        yield jf.read(path)
    yield jf.read(folder / "odrive" / "slow_compensated.csv")
    yield jf.read(folder / "odrive" / "slow_uncompensated.csv")
    yield jf.read(folder / "ur10e" / "joint_1.csv", columns={"force": "current"})


@pytest.mark.slow
def test_real_positions_decimated_give_the_same_velocity_or_it_is_said(data_folder):
    """The velocity of the whole record is the reference; down to 20 Hz."""
    for whole in real(data_folder):
        record = jax.tree.map(np.asarray, changed(whole, velocity=None, channels={}))
        velocity = np.asarray(jf.signals.prepare(record).velocity)
        size = np.sqrt(np.mean(velocity**2))
        for step in (1, 2, 5, 10, 20, 50):
            coarse = jax.tree.map(lambda x, step=step: x[::step], record)
            if jf.signals.host_interval(coarse) > 0.0501:
                continue
            found = np.asarray(jf.signals.prepare(coarse).velocity)
            error = np.sqrt(np.mean((found - velocity[::step]) ** 2)) / size
            told = {"coarse_sampling", "velocity_noise", "no_motion"} & set(names(coarse))
            assert error < 0.01 or told, (whole.source, step, error)


def test_real_recordings_have_no_remark_at_full_rate(data_folder):
    """But the odrive's, whose stamps jitter by the bus, about a velocity that is known to 4 %; and
    the servo's, whose velocity is a difference quotient of the cycle before.
    """
    for record in real(data_folder):
        found = set(names(record)) - {"magnitude"}
        # It turned one way, too.
        odrive = {"coarse_sampling", "one_direction"} if "odrive" in record.source else set()
        servo = {"velocity_late"} if "delta_servo" in record.source else set()
        assert found <= odrive | servo, found


def hidden(force):
    """What an axis over a stroke, `(800,)` rows, leaves of a force of inertia, Coulomb, viscous."""
    time = np.arange(800) * 0.01
    position = np.sin(1.3 * time) + 0.6 * np.sin(2.9 * time + 1)
    velocity = np.gradient(position, time)
    columns = np.stack([np.gradient(velocity, time), np.sign(velocity), velocity], axis=1)
    alpha = np.array([1.0, 3.0, 0.4])
    target = columns @ alpha + force(position, velocity)
    alpha, *_ = np.linalg.lstsq(columns, target, rcond=None)
    left, shift = target - columns @ alpha, np.zeros(3)
    design = Design(columns, target, left, np.ones(len(time)), time, shift)
    return checks.hides(design, time, position, np.ones(len(time), bool), alpha, [0, 1, 2])


@pytest.mark.parametrize("seed", range(5))
def test_what_repeats_with_the_place_may_hide_a_parameter_and_noise_does_not(seed):
    draw = np.random.default_rng(seed)
    assert hidden(lambda x, v: 1.0 * np.sin(9 * x) + 0.05 * draw.normal(size=len(x)))
    assert hidden(lambda x, v: 0.4 * np.sin(9 * x) + 0.05 * draw.normal(size=len(x)))
    assert not hidden(lambda x, v: 0.05 * np.sin(9 * x) + 0.05 * draw.normal(size=len(x)))
    assert not hidden(lambda x, v: 0.6 * draw.normal(size=len(x)))


def test_a_number_for_a_missing_force_is_told_and_a_drive_that_is_off_is_not():
    sound = log()
    force = np.array(sound.force)
    speed = np.abs(np.gradient(np.asarray(sound.position)))
    force[speed < np.quantile(speed, 0.1)] = 0.0
    assert "force_filler" not in names(changed(sound, force=force))
    force = np.array(sound.force)
    force[np.random.default_rng(0).random(len(force)) < 0.05] = -1.1 * np.max(np.abs(force)) / 2
    assert "force_filler" in names(changed(sound, force=force))


def test_a_force_drawn_finer_than_it_was_logged_is_told():
    sound = log()
    time, force = np.asarray(sound.time), np.asarray(sound.force)
    for every, told in ((40, True), (4, False)):
        fine = np.interp(time, time[::every], force[::every])
        assert ("force_interpolated" in names(changed(sound, force=fine))) == told
