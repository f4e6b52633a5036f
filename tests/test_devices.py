"""Rows over several devices and several processes: the same numbers as one recording alone."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification import devices, solving
from jaxfric.identification.identified import result_names

ROOT = Path(__file__).parents[1]

# What a process does: as many devices as it is told, its own rows of a batch of four recordings.
PROGRAM = """
import json, sys
import jax
count, index, processes, address = int(sys.argv[1]), *map(int, sys.argv[2:4]), sys.argv[4]
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", count)
if processes > 1:
    jax.distributed.initialize(address, processes, index)
sys.path.insert(0, sys.argv[5])
import jaxfric as jf
from jaxfric import devices
from tests.test_devices import recordings
assert jax.device_count() == count * processes
own = recordings()[index::processes]
found = devices.identify(
    "coulomb-viscous", jf.stack(own), projection=jf.ClosedWindows()
)
print(json.dumps({k: e.value.tolist() for k, e in found.parameters.items()}))
"""


def recordings():
    """Three axes that move, and one that rests."""
    time = np.arange(801) / 500
    found = []
    for i in range(3):
        rate = 2 * np.pi * (1.25 + i / 8)
        speed, change = 0.1 * np.sin(rate * time), 0.1 * rate * np.cos(rate * time)
        force = 2.0 * change + (10.0 + i) * np.sign(speed) + 40.0 * speed
        noise = 0.1 * np.sin(1e3 * np.arange(time.size) ** 2)
        found.append(jf.Recording(time, force + noise, velocity=speed))
    rest = np.zeros_like(time)
    return [*found, jf.Recording(time, rest, velocity=rest)]


def alone():
    """What each recording gives by itself, with the projection that the batch has."""
    found = [jf.identify("coulomb-viscous", r, projection=jf.ClosedWindows()) for r in recordings()]
    return {k: np.array([f.parameters[k].value for f in found]) for k in found[0].parameters}


@pytest.fixture(scope="module")
def expected():
    return alone()


def start(count, index, processes, address):
    environment = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    command = [sys.executable, "-c", PROGRAM, *map(str, (count, index, processes, address, ROOT))]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, env=environment, cwd=ROOT, **pipes)


def values(process):
    out, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    found = json.loads(out.strip().splitlines()[-1])
    return {name: np.array(rows, float) for name, rows in found.items()}


def agree(found, expected):
    # The rows are computed alike; what differs is the order of sums that the compiler chose,
    # some rounding times the condition of the columns.
    for name, rows in expected.items():
        np.testing.assert_allclose(found[name], rows, rtol=1e-9, err_msg=name)


@pytest.mark.slow
def test_one_device_does_all_rows(expected):
    found = devices.identify(
        "coulomb-viscous", jf.stack(recordings()), projection=jf.ClosedWindows()
    )
    names = [result_names()[i] for i in found.result._value]
    assert names == ["successful"] * 3 + ["no_slip"]
    agree({name: estimate.value for name, estimate in found.parameters.items()}, expected)


def test_a_single_recording_is_refused():
    with pytest.raises(ValueError, match=r"stack\(\[recording\]\)"):
        devices.identify("coulomb-viscous", recordings()[0])


@pytest.mark.slow
def test_throw_names_the_row():
    with pytest.raises(ValueError, match="Row 3.*never slips"):
        devices.identify(
            "coulomb-viscous",
            jf.stack(recordings()),
            projection=jf.ClosedWindows(),
            throw=True,
        )


def test_a_velocity_is_smoothed_with_the_width_that_suits_its_row():
    """Beside a noisy recording, a clean one keeps the velocity that it has alone."""
    time = np.arange(1001) / 500
    place = np.cos(2 * np.pi * time)
    noise = 0.02 * np.random.default_rng(0).normal(size=time.size)
    pair = [jf.Recording(time, place, position=place + x) for x in (0.0, noise)]
    from jaxfric.identification.setup import set_up

    both = set_up(
        "coulomb-viscous", jf.stack(pair), jf.ClosedWindows(), width=16
    ).recording.velocity
    for row, single in zip(both, pair, strict=True):
        expected = jf.signals.prepare(single).velocity
        np.testing.assert_allclose(row, expected, rtol=0, atol=1e-9)
    assert float(jnp.max(jnp.abs(both[0] - both[1]))) > 1e-3


@pytest.mark.slow
def test_an_accelerator_takes_all_rows_at_once_and_says_the_same(monkeypatch):
    logs = jf.stack(recordings()[:3])
    alone = jf.identify("coulomb-viscous", logs)
    assert solving._at_once(3, 2000) == 3 and solving._at_once(100, 2000) == 8
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert solving._at_once(100, 2000) == 100
    assert solving._at_once(10**6, 2000) * 2000 <= solving.SAMPLES
    assert solving._at_once(3, 10**8) == 1
    there = jf.identify("coulomb-viscous", logs)
    np.testing.assert_allclose(there.model.alpha, alone.model.alpha, rtol=1e-9)


@pytest.mark.slow
def test_rows_go_over_the_devices_of_one_process(expected):
    agree(values(start(3, 0, 1, "-")), expected)  # four rows on three devices: two are filled up


@pytest.mark.slow
def test_rows_go_over_two_processes(expected):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    both = [start(2, index, 2, address) for index in range(2)]
    try:
        found = [values(process) for process in both]
    finally:
        for process in both:
            process.kill()
    for index, own in enumerate(found):
        agree(own, {name: rows[index::2] for name, rows in expected.items()})


def test_jax_is_left_as_it_was():
    before = dict(jax.config.values)
    devices.mesh()
    assert before == dict(jax.config.values)
