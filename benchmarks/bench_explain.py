"""One explanation of 30 s at 1 kHz: a process from cold, one with its programs cached, and warm."""

import dataclasses
import os
import subprocess
import sys

import jax
import numpy as np
import pytest

from jaxfric import PD, Encoder, Recording, models, simulate
from jaxfric.explanation import explain

PITCH = 0.01


@pytest.fixture(scope="module")
def axis():
    """An axis with cogging of a tenth of its Coulomb friction, in closed loop."""
    time = np.arange(30_000) / 1000.0
    rates = 2 * np.pi * np.array([0.31, 0.73, 1.37])
    x = sum(0.03 * np.sin(w * time + i) / (i + 1) for i, w in enumerate(rates))
    v = sum(0.03 * w * np.cos(w * time + i) / (i + 1) for i, w in enumerate(rates))
    values = {"inertia": 5.0} | {
        f"{name}{sign}": value
        for sign in "+-"
        for name, value in (("coulomb", 20.0), ("viscous", 60.0), ("stribeck_force", 6.0),
                            ("stribeck_velocity", 0.01))
    }  # fmt: skip
    machine = models.from_parameters(models.gaussian(), values)
    clock = Recording(time, np.zeros_like(time), x, v)
    run = simulate(
        machine, clock, PD(kp=18000.0, kd=600.0), encoder=Encoder(resolution=1e-6),
        force_noise=0.2, key=jax.random.key(0), substeps=8,
    )  # fmt: skip
    wave = 2.8 * np.sin(2 * np.pi * np.asarray(run.position) / PITCH)
    return dataclasses.replace(run, force=run.force + wave, channels={}, source="axis")


@pytest.fixture(scope="module")
def csv(axis, tmp_path_factory):
    path = tmp_path_factory.mktemp("explain") / "axis.csv"
    table = np.column_stack([np.asarray(x) for x in (axis.time, axis.position, axis.force)])
    np.savetxt(path, table, "%.9g", ",", header="time,position,force", comments="")
    return path


def process(folder, path):
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    command = [sys.executable, "-m", "jaxfric", "explain", str(path)]
    subprocess.run(command, env=environment, check=True, capture_output=True)


def test_explain_from_cold(benchmark, tmp_path_factory, csv):
    benchmark.pedantic(lambda: process(tmp_path_factory.mktemp("cache"), csv), rounds=1)


def test_explain_with_cached_programs(benchmark, tmp_path, csv):
    benchmark.pedantic(lambda: process(tmp_path, csv), rounds=1, warmup_rounds=1)


def test_explain_warm(benchmark, axis):
    found = benchmark.pedantic(lambda: explain(axis), rounds=2, warmup_rounds=1)
    assert [f.effect for f in found.findings] == ["cogging"]
    pitch = float(found.findings[0].parameters["pitch"].value)
    benchmark.extra_info["error of the pitch"] = abs(pitch / PITCH - 1)
