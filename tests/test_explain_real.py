"""What real recordings are explained by, where their authors or another measurement say it."""

import math

import pytest

from jaxfric import read
from jaxfric.explanation import explain

pytestmark = pytest.mark.slow


def test_emps_friction_is_asymmetric_and_the_screw_ripples(data_folder):
    """Janot, Gautier & Brunot 2019: asymmetric by screw fatigue; and 400 ripples a metre."""
    pytest.importorskip("scipy")
    reading = {"columns": {"force": "vir", "position": "qm"}, "scale": {"force": 35.15065}}
    run = read(data_folder / "emps" / "DATA_EMPS.mat", **reading)
    held = read(data_folder / "emps" / "DATA_EMPS_PULSES.mat", **reading)
    found = explain(run, "symmetric-coulomb-viscous", held)
    assert found.findings[0].effect == "asymmetric_friction"
    assert found.findings[0].holdout_share > 0.2
    pitches = [float(f.parameters["pitch"].value) for f in found.findings if f.effect == "cogging"]
    assert any(abs(pitch - 0.0025) < 1e-5 for pitch in pitches)
    for key in ("force_error", "holdout_force_error"):
        errors, plain = found.fit[f"filtered_{key}"], found.fit[key]
        assert errors["after"] < 0.75 * errors["before"] and plain["after"] < plain["before"]


@pytest.mark.parametrize("run", ["slow_uncompensated", "slow_compensated"])
def test_odrive_cogging_agrees_with_the_map_measured_at_rest(data_folder, run):
    """Seven and twelve times a revolution; with compensation the same current, supplied by it."""
    turn = 8192
    found = explain(
        read(
            data_folder / "odrive" / f"{run}.csv",
            columns={"force": "current", "position": "position_counts"},
            scale={"position": 2 * math.pi / turn},
            units={"force": "A", "position": "rad"},
        ),
        "coulomb-viscous",
    )
    waves = {
        round(2 * math.pi / float(f.parameters["pitch"].value)): float(
            f.parameters["amplitude"].value
        )
        for f in found.findings
        if f.effect == "cogging"
    }
    assert 7 in waves and 12 in waves
    assert 0.65 < waves[7] < 0.95  # 0.86 A by holding each position, 0.81 A by a Fourier fit
    errors, plain = (found.fit[key] for key in ("filtered_force_error", "force_error"))
    assert errors["after"] < 0.2 * errors["before"]
    # Sample by sample the acceleration of so slow a run is noise, which the inertia multiplies.
    assert plain["after"] < 0.5 * plain["before"]


def test_a_servo_motor_cogs_with_its_pole_pairs(data_folder):
    """Five times a revolution. More is left, and said to be: pushes at nine moments, which would
    take it down to two thirds of the error, cost more parameters than the evidence carries.
    """
    folder = data_folder / "delta_servo"
    run, held = (read(folder / f"S1_{i}.csv") for i in (1, 2))
    found = explain(run, "coulomb-viscous", held)
    lines = [f.parameters["pitch"].value for f in found.findings if f.effect == "cogging"]
    assert any(float(pitch) == pytest.approx(2 * math.pi / 5, rel=0.015) for pitch in lines)
    errors = found.fit["filtered_holdout_force_error"]
    assert errors["after"] < 0.87 * errors["before"]
    assert found.verdict == "partly_explained"
    assert "disturbance_pulses" not in {f.effect for f in found.findings}
