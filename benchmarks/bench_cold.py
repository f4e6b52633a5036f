"""Mark 6: whole processes from nothing, as a user starts them."""

import os
import subprocess
import sys

import numpy as np
import peers
import pytest


@pytest.fixture(scope="module")
def csv(tmp_path_factory):
    recording = peers.axis(25_000)
    path = tmp_path_factory.mktemp("cold") / "axis.csv"
    table = np.stack([np.asarray(x) for x in (recording.time, recording.velocity, recording.force)])
    np.savetxt(path, table.T, "%.9g", ",", header="time,velocity,force", comments="")
    return path


def process(folder, *arguments):
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    command = [sys.executable, "-m", "jaxfric", *map(str, arguments)]
    subprocess.run(command, env=environment, check=True, capture_output=True)


def test_help(benchmark, tmp_path):
    benchmark.pedantic(lambda: process(tmp_path, "--help"), rounds=5, warmup_rounds=1)


def test_numpy_alone(benchmark):
    command = [sys.executable, "-c", "import numpy"]
    benchmark.pedantic(lambda: subprocess.run(command, check=True), rounds=5, warmup_rounds=1)


def test_identify_warm_cache(benchmark, tmp_path, csv):
    call = lambda: process(tmp_path, "identify", csv, "--model", "gaussian")  # noqa: E731
    benchmark.pedantic(call, rounds=3, warmup_rounds=1)


def test_identify_no_cache(benchmark, tmp_path_factory, csv):
    def fresh():
        process(tmp_path_factory.mktemp("cache"), "identify", csv, "--model", "gaussian")

    benchmark.pedantic(fresh, rounds=2)
