"""The force of a simulator that this package knows nothing of, through a file: pinocchio's."""

import json

import numpy as np
import pytest

from jaxfric import cli

pin = pytest.importorskip(
    "pinocchio", reason='pinocchio is not installed (pip install "jaxfric[pinocchio]", 380 MB)'
)

LINK = """<link name="{name}"><inertial><origin xyz="{half} 0 0"/><mass value="{mass}"/><inertia
 ixx="0.001" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{at} 0 0"/><axis xyz="0 1 0"/></joint>"""


def arm():
    """A two-joint arm that hangs from the world, by its URDF."""
    links = [
        '<link name="base"/>',
        LINK.format(name="upper", half=0.15, mass=2.0, inertia=0.015),
        LINK.format(name="fore", half=0.12, mass=1.2, inertia=0.006),
    ]
    joints = [
        JOINT.format(name="shoulder", parent="base", child="upper", at=0),
        JOINT.format(name="elbow", parent="upper", child="fore", at=0.3),
    ]
    return pin.buildModelFromXML(f'<robot name="arm">{"".join(links + joints)}</robot>')


def moved(seed, friction, count=9000, step=0.002):
    """Time, positions `(N, 2)`, and the elbow's force by pinocchio's inverse dynamics."""
    draw, time = np.random.default_rng(seed), step * np.arange(count)
    rates, sizes = 2 * np.pi * np.array([0.3, 0.7, 1.3]), np.array([0.5, 0.2, 0.1])
    angle = rates * time[:, None, None] + draw.uniform(0, 6, (2, 3))
    position, velocity = np.sin(angle) @ sizes, np.cos(angle) @ (rates * sizes)
    acceleration = -np.sin(angle) @ (rates**2 * sizes)
    model = arm()
    data = model.createData()
    # A joint without limits is a point on the circle.
    circle = np.stack([np.cos(position), np.sin(position)], axis=2).reshape(count, 4)
    rows = zip(circle, velocity, acceleration, strict=True)
    force = np.array([pin.rnea(model, data, *row)[1] for row in rows])
    v = velocity[:, 1]
    return time, position[:, 1], force + friction["viscous"] * v + friction["coulomb"] * np.sign(v)


def written(path, time, position, force):
    table = np.stack([time, position, force], axis=1)
    np.savetxt(path, table, delimiter=",", header="time,position,force", comments="", fmt="%.9g")
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize("viscous", [0.5, 0.8])
def test_a_force_from_pinocchio_through_a_file(tmp_path, viscous):
    """What agrees is consistent; one wrong value is that value, in its interval."""
    logs, ours = [], []
    for seed in (1, 2):
        time, position, force = moved(seed, {"viscous": viscous, "coulomb": 0.15})
        noise = 0.005 * force.std() * np.random.default_rng(seed).normal(size=force.size)
        logs.append(written(tmp_path / f"log{seed}.csv", time, position, force + noise))
        known = moved(seed, {"viscous": 0.5, "coulomb": 0.15})
        ours.append(written(tmp_path / f"sim{seed}.csv", *known))
    out = tmp_path / "out.json"
    options = ["--simulation", ours[0], "--holdout", logs[1], "--simulation-holdout", ours[1]]
    units = ["--units", "force=N·m,position=rad"]
    assert cli.main(["explain", logs[0], *options, *units, "--json", str(out)]) == 0
    told = json.loads(out.read_text())
    if viscous == 0.5:
        assert told["verdict"] == "consistent" and not told["findings"]
        return
    (finding,) = told["findings"]
    assert told["verdict"] == "explained" and set(finding["parameters"]) == {"viscous"}
    value = finding["parameters"]["viscous"]
    assert abs(value["to"] - 0.3) < 3 * value["standard_error"] + 1e-3
