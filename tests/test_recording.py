"""Recordings: what they accept, what they refuse, how they stack."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric.data.recording import Recording, pad, stack
from jaxfric.data.summary import facts


def log(n=5, **signals):
    t = np.arange(n, dtype=float)
    return Recording(**({"time": t, "force": 2 * t, "velocity": 3 * t} | signals))


# ---- what it accepts ----


@pytest.mark.parametrize("kind", [list, tuple, np.asarray, jnp.asarray], ids=lambda k: k.__name__)
def test_signals_of_any_kind_become_arrays(kind):
    values = kind([0.0, 0.5, 1.0])
    recording = Recording(time=values, force=values, position=values, channels={"load": values})
    for signal in (recording.time, recording.position, recording.channels["load"]):
        assert isinstance(signal, jax.Array)
        assert signal.dtype == jnp.float64
    assert recording.num_samples == 3


def test_encoder_counts_become_floating_point():
    counts = np.array([0, 1, 3])
    recording = Recording(time=counts, force=counts, position=counts)
    assert recording.position.dtype == jnp.float64
    np.testing.assert_array_equal(recording.position, [0.0, 1.0, 3.0])


def test_single_precision_stays_single():
    values = np.array([0.0, 1.0], np.float32)
    assert Recording(time=values, force=values, velocity=values).force.dtype == jnp.float32


def test_everything_is_valid_and_one_segment_unless_said():
    recording = log()
    assert recording.mask.dtype == bool
    assert bool(jnp.all(recording.mask))
    assert not bool(jnp.any(recording.segment))
    assert recording.num_segments == 1


def test_a_mask_of_numbers_becomes_flags():
    mask = log(3, mask=[1, 0, 1.0]).mask
    assert mask.dtype == bool
    np.testing.assert_array_equal(mask, [True, False, True])


def test_segments_are_counted():
    assert log(segment=[0, 0, 1, 1, 2]).num_segments == 3


def test_units_default_to_newton_and_metre():
    assert log().unit_names == {"force": "N", "position": "m"}
    assert log(units={"force": "N·m"}).unit_names == {"force": "N·m", "position": "m"}


def test_it_is_a_pytree_that_passes_through_jit():
    recording = log(channels={"load": np.ones(5)}, units={"position": "rad"}, source="a.csv")
    leaves, structure = jax.tree.flatten(recording)
    again = jax.jit(lambda r: r)(jax.tree.unflatten(structure, leaves))
    assert again.units == recording.units
    assert again.source == "a.csv"
    assert jax.tree.structure(again) == structure
    for old, new in zip(leaves, jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(old, new)


# ---- what it refuses ----


@pytest.mark.parametrize("name", ["force", "velocity", "position", "mask", "segment"])
def test_a_signal_of_another_length_is_named(name):
    wrong = np.zeros(4, int) if name == "segment" else np.zeros(4)
    with pytest.raises(ValueError, match=rf"time has \(5,\), {name} has \(4,\)"):
        log(**{name: wrong})


def test_a_channel_of_another_length_is_named():
    with pytest.raises(ValueError, match=r"load has \(2,\)"):
        log(channels={"load": [1.0, 2.0]})


def test_neither_position_nor_velocity_is_refused():
    t = np.arange(3.0)
    with pytest.raises(ValueError, match=r"position or velocity.*axis\.csv has neither"):
        Recording(time=t, force=t, source="axis.csv")


def test_segments_inside_jit_need_their_number():
    def build(segment, count):
        return log(segment=segment, num_segments=count).segment

    segment = jnp.asarray([0, 0, 1, 1, 1])
    with pytest.raises(ValueError, match="num_segments="):
        jax.jit(lambda s: build(s, None))(segment)
    np.testing.assert_array_equal(jax.jit(lambda s: build(s, 2))(segment), segment)


# ---- padding and stacking ----


@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.parametrize("extra", [0, 1, 5])
def test_padding_adds_invalid_samples_only(n, extra):
    before = log(n, mask=np.arange(n) % 2 == 0, segment=np.arange(n) // 3)
    after = pad(before, n + extra)
    assert after.num_samples == n + extra
    for old, new in zip(jax.tree.leaves(before), jax.tree.leaves(after), strict=True):
        np.testing.assert_array_equal(new[:n], old)
    assert not bool(jnp.any(after.mask[n:]))
    assert bool(jnp.all(jnp.diff(after.time) >= 0))
    assert after.num_segments == before.num_segments


def test_padding_to_less_is_refused():
    with pytest.raises(ValueError, match="pad 5 samples to 4"):
        pad(log(5), 4)


def test_a_stack_has_its_recordings_as_rows():
    recordings = [log(3), log(5, segment=[0, 0, 1, 1, 2]), log(4)]
    batch = stack(recordings)
    assert batch.time.shape == (3, 5)
    assert batch.num_segments == 3
    assert batch.num_samples == 5
    for i, recording in enumerate(recordings):
        n = recording.num_samples
        np.testing.assert_array_equal(batch.force[i, :n], recording.force)
        np.testing.assert_array_equal(batch.mask[i], np.arange(5) < n)


def test_a_stack_passes_through_vmap():
    def work(recording):
        return jnp.sum(jnp.where(recording.mask, recording.force * recording.velocity, 0.0))

    recordings = [log(3), log(5)]
    together = jax.vmap(work)(stack(recordings))
    np.testing.assert_allclose(together, [float(work(r)) for r in recordings])


def test_nothing_to_stack_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        stack([])


@pytest.mark.parametrize(
    "other",
    [
        {"position": np.zeros(5)},
        {"channels": {"load": np.zeros(5)}},
        {"units": {"force": "A"}},
    ],
    ids=["signals", "channels", "units"],
)
def test_recordings_that_differ_do_not_stack_and_the_odd_one_is_named(other):
    with pytest.raises(ValueError, match=r"number 2 \(odd\.csv\) has"):
        stack([log(), log(), log(source="odd.csv", **other)])


def test_samples_left_out_have_their_place_in_the_clock():
    t = np.arange(2000) / 1000
    mask = np.arange(2000) % 100 > 2
    log = Recording(t, np.ones(2000), t, mask=mask)
    assert facts(pad(log, 2500))["sample_rate"] == pytest.approx(1000.0)
    assert facts(pad(log, 2500))["used"] == mask.sum()
    broken = Recording(np.concatenate([t, t]), np.ones(4000), np.concatenate([t, t]),
                          mask=np.tile(mask, 2), segment=np.repeat([0, 1], 2000))  # fmt: skip
    assert facts(broken)["sample_rate"] == pytest.approx(1000.0)
