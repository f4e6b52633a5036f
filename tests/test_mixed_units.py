"""A fleet whose recordings are not in one unit says so, and one of unlike machines does not."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from jaxfric import fleet, models
from jaxfric.fleet.files import File
from jaxfric.fleet.mixed import FACTORS

MODEL = "gaussian"
TERM = models.named(MODEL)
DIMENSIONS = {p.name: p.dimension for p in (*TERM.affine, *TERM.nonlinear)}


def a_fleet(count, seed, scatter, changes=(), units="?"):
    """Files and rows of like machines; `changes`: for each file the factors of its numbers."""
    draw = np.random.default_rng(seed)
    typical = {name: 10 ** draw.uniform(-3, 3) for name in DIMENSIONS}
    files = [File(f"{i}.csv", {}, "", "", 0, 0) for i in range(count)]
    rows = {}
    for i, file in enumerate(files):
        parameters = {}
        for name, dimension in DIMENSIONS.items():
            value = typical[name] * math.exp(scatter * draw.normal())
            for quantity, factor in dict(changes).get(i, {}).items():
                value *= factor ** getattr(dimension, quantity)
            parameters[name] = {"value": value, "standard_error": 0.02 * value, "unit": units}
        rows[file.path] = {"result": "successful", "parameters": parameters}
    return files, rows


@given(
    seed=st.integers(0, 10_000),
    quantity=st.sampled_from(sorted(FACTORS)),
    choice=st.integers(0, 7),
    inverse=st.booleans(),
    count=st.integers(8, 20),
    scatter=st.floats(0.02, 0.15),
    data=st.data(),
)
def test_a_part_in_another_unit_is_named_with_its_factor(
    seed, quantity, choice, inverse, count, scatter, data
):
    factor = FACTORS[quantity][choice % len(FACTORS[quantity])] ** (-1 if inverse else 1)
    some = data.draw(st.integers(2, (count - 1) // 2))
    files, rows = a_fleet(count, seed, scatter, {i: {quantity: factor} for i in range(some)})
    (sentence,) = fleet.mixed_units(files, rows, MODEL)
    assert f"{some} recordings (0.csv" in sentence
    assert f"unit of {quantity}" in sentence
    told = float(sentence.rsplit("=", 1)[1].rstrip("."))
    # 57.3 and 60 are told apart only by fleets that scatter little.
    assert told == pytest.approx(1 / factor, rel=0.1)


@given(
    seed=st.integers(0, 10_000),
    count=st.integers(3, 30),
    scatter=st.floats(0.02, 1.0),
    larger=st.floats(1.0, 30.0),
)
def test_unlike_machines_are_not_taken_for_other_units(seed, count, scatter, larger):
    """Half of the machines are larger: more mass, more friction, the same lubricant."""
    files, rows = a_fleet(count, seed, scatter)
    for file in files[: count // 2]:
        for name, entry in rows[file.path]["parameters"].items():
            if DIMENSIONS[name].force:
                entry["value"] *= larger
                entry["standard_error"] *= larger
    assert fleet.mixed_units(files, rows, MODEL) == ()


def test_units_that_are_stated_differently_are_listed():
    files, rows = a_fleet(6, 1, 0.1)
    for file in files[:2]:
        for entry in rows[file.path]["parameters"].values():
            entry["unit"] = "!"
    (sentence,) = fleet.mixed_units(files, rows, MODEL)
    assert "in ! in 2 recordings (0.csv, 1.csv)" in sentence
    assert "in ? in 4 recordings (2.csv, 3.csv, 4.csv and 1 more)" in sentence
    assert "--scale" in sentence
