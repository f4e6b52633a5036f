"""The real recordings that benchmarks use where they are: none of them comes with the project."""

import math
import os
from pathlib import Path

from planting import Log

EMPS = {"columns": {"force": "vir", "position": "qm"}, "scale": {"force": 35.15065}}
SERVO = {"units": {"force": "N·m", "position": "rad"}}
JOINT = {
    "columns": {"force": "desired_current", "position": "position", "velocity": None},
    "units": {"force": "A", "position": "rad"},
}
TURN = 8192
ODRIVE = {
    "columns": {"force": "current", "position": "position_counts"},
    "scale": {"position": 2 * math.pi / TURN},
    "units": {"force": "A", "position": "rad"},
}


def folder() -> Path:
    """What JAXFRIC_DATA names, or `../shared/data` beside the project."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("JAXFRIC_DATA", beside))


def logs() -> list[Log]:
    """Those to plant in, of which the files are there."""
    at = folder()
    known = [
        ("emps", "coulomb-viscous", "emps/DATA_EMPS.mat", "emps/DATA_EMPS_PULSES.mat", EMPS),
        ("delta_servo", "coulomb-viscous", "delta_servo/S1_1.csv", "delta_servo/S1_2.csv", SERVO),
        ("ur10e", "gaussian", "ur10e/joint_1.csv", None, JOINT),  # with an evident bump
    ]
    return [
        Log(name, str(at / file), held and str(at / held), baseline, reading)
        for name, baseline, file, held, reading in known
        if (at / file).is_file()
    ]
