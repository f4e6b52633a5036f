"""Programs kept on disk: the same results, no tracing, and no harm from a bad file."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import programs


class Pair(eqx.Module):
    value: jax.Array
    name: str = eqx.field(static=True)


class Traces:
    count = 0


@programs.kept
def double(pair, power, table):
    Traces.count += 1
    return Pair(2 * pair.value**power, pair.name), table["shift"] + 1


@pytest.fixture(autouse=True)
def fresh():
    Traces.count = 0
    jax.clear_caches()


ARGUMENTS = (Pair(np.arange(3.0), "a"), 2, {"shift": np.ones(2)})


def call(folder, arguments=ARGUMENTS):
    with programs.kept_in(folder):
        return double(*arguments)


def files(folder):
    return sorted(folder.glob("*.program"))


def test_a_kept_program_is_not_traced_again(tmp_path):
    first, second = call(tmp_path), call(tmp_path)
    assert Traces.count == 1 and len(files(tmp_path)) == 1
    assert not [f for f in tmp_path.iterdir() if f.suffix != ".program"]
    plain = double(*ARGUMENTS)
    assert jax.tree.structure(first) == jax.tree.structure(second) == jax.tree.structure(plain)
    for a, b, c in zip(*map(jax.tree.leaves, (first, second, plain)), strict=True):
        np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(a, c)


def test_whatever_decides_a_program_is_in_its_name(tmp_path):
    pair, power, table = ARGUMENTS
    others = [
        (Pair(pair.value, "b"), power, table),
        (pair, 3, table),
        (Pair(np.arange(4.0), "a"), power, table),
        (Pair(np.arange(3, dtype=np.float32), "a"), power, table),
    ]
    call(tmp_path)
    for arguments in others:
        call(tmp_path, arguments)
    assert len(files(tmp_path)) == Traces.count == 5
    call(tmp_path, (Pair(np.zeros(3), "a"), power, table))  # values do not
    assert Traces.count == 5


def first(scale, pair):
    Traces.count += 1
    return Pair(scale * pair.value, pair.name), None


def second(before, scale, pair):
    Traces.count += 1
    (scaled, nothing) = before
    assert nothing is None and scaled.name == pair.name
    return scaled.value - pair.value, pair


def test_steps_are_kept_one_by_one(tmp_path):
    steps = programs.kept(first, second)
    plain = steps(3, ARGUMENTS[0])
    Traces.count = 0
    for again, traced in ((None, 2), (None, 0), ("first", 1), ("second", 1)):
        for path in files(tmp_path):
            if again is not None and again in path.name:
                path.unlink()
        with programs.kept_in(tmp_path):
            found = steps(3, ARGUMENTS[0])
        assert Traces.count == traced and len(files(tmp_path)) == 2
        assert jax.tree.structure(found) == jax.tree.structure(plain)
        np.testing.assert_array_equal(found[0], [0.0, 2.0, 4.0])
        np.testing.assert_array_equal(found[1].value, plain[1].value)
        Traces.count = 0


def test_a_step_that_fails_says_so(tmp_path):
    def fails(before, scale, pair):
        raise ValueError("no such model")

    with programs.kept_in(tmp_path), pytest.raises(ValueError, match="no such model"):
        programs.kept(first, fails)(3, ARGUMENTS[0])
    assert not files(tmp_path) and not any(tmp_path.iterdir())


@pytest.mark.parametrize("damage", [b"", b"not a program", None])
def test_a_damaged_program_is_made_anew(tmp_path, damage):
    call(tmp_path)
    (path,) = files(tmp_path)
    path.write_bytes(path.read_bytes()[:-100] if damage is None else damage)
    np.testing.assert_array_equal(call(tmp_path)[0].value, [0.0, 2.0, 8.0])
    assert Traces.count == 2
    call(tmp_path)
    assert Traces.count == 2


def test_a_folder_that_cannot_be_written_does_no_harm(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    np.testing.assert_array_equal(call(blocked)[0].value, [0.0, 2.0, 8.0])


def test_inside_a_trace_it_is_an_ordinary_function(tmp_path):
    def total(value):
        with programs.kept_in(tmp_path):
            return jnp.sum(double(Pair(value, "a"), 2, {"shift": jnp.ones(2)})[0].value)

    np.testing.assert_allclose(jax.jit(jax.grad(total))(jnp.arange(3.0)), [0.0, 4.0, 8.0])
    assert not files(tmp_path)


def test_the_oldest_programs_go(tmp_path, monkeypatch):
    call(tmp_path)
    size = files(tmp_path)[0].stat().st_size
    monkeypatch.setattr(programs, "MOST", int(2.5 * size))
    for power in range(4):
        call(tmp_path, (ARGUMENTS[0], power, ARGUMENTS[2]))
        Traces.count = 0
    assert len(files(tmp_path)) == 2
    call(tmp_path, (ARGUMENTS[0], 3, ARGUMENTS[2]))
    assert Traces.count == 0


def test_what_is_optimised_a_little_is_so_without_a_folder_too(tmp_path):
    plain = programs.kept(first, second)
    little = programs.kept(first, second, optimised=programs.LITTLE)
    expected = plain(3, ARGUMENTS[0])[0]
    np.testing.assert_array_equal(little(3, ARGUMENTS[0])[0], expected)
    # Options of the compiler are for whole programs only; inside another it has none.
    inside = eqx.filter_jit(lambda pair: little(3, pair)[0])
    np.testing.assert_array_equal(inside(Pair(jnp.arange(3.0), "a")), expected)
    with programs.kept_in(tmp_path):
        np.testing.assert_array_equal(little(3, ARGUMENTS[0])[0], expected)


def test_files_of_other_names_units_and_lengths_share_their_programs():
    """What is compiled for the first of ten serves the nine others, of the same padded length."""
    compiled = []

    def listen(event, duration, **facts):
        if "backend_compile" in event:
            compiled.append(event)

    logs = []
    for i in range(10):
        time = np.arange(1100 + 17 * i) / 500
        speed = 0.1 * np.sin(2 * np.pi * time) + 0.05 * np.sin(7 * time + i)
        noise = 0.1 * np.random.default_rng(i).normal(size=time.size)
        units = {"force": ("N", "kN", "A")[i % 3], "position": ("m", "mm")[i % 2]}
        force = 5 * np.sign(speed) + 3 * speed + np.gradient(speed, time) + noise
        logs.append(jf.Recording(time, force, None, speed, units=units, source=f"log{i}.csv"))
    jax.monitoring.register_event_duration_secs_listener(listen)
    counts, found = [], []
    for log in logs:
        before = len(compiled)
        found.append(jf.identify("coulomb-viscous", log))
        counts.append(len(compiled) - before)
    assert counts[1:] == [0] * 9, counts
    assert found[1].parameters["coulomb+"].unit == "kN" and found[2].model.units[0][1] == "A"
