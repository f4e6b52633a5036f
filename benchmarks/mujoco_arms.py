"""Arms of six joints drawn in MuJoCo, each joint explained from a nominal MuJoCo model.

    python benchmarks/mujoco_arms.py --arms 10 --seed 1

Sizes, masses, friction, controllers and paths are drawn. In two arms of three one joint of the
plant differs by one value or by physics that the model lacks; all the other joints differ by
nothing, and have to be called consistent. Needs MuJoCo.
"""

import argparse
import collections
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import mujoco
import numpy as np
from mujoco_proof import outcome_of, said

import jaxfric as jf

JOINTS = tuple(f"joint{i}" for i in range(1, 7))
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
VALUES = {"damping": "damping", "friction": "frictionloss", "armature": "armature"}
KINDS = (*VALUES, "cogging", "stribeck", "drag", "asymmetry")
# Of a path's three sines, rad, and their rates in parts of the fastest; what is logged begins when
# the loop has settled, s.
SIZES, RATES, SETTLED = np.array([0.6, 0.3, 0.12]), np.array([0.23, 0.54, 1.0]), 0.5
LINK = """<body name="link{number}" pos="{at}"><joint name="joint{number}" axis="{axis}"
 damping="{damping}" frictionloss="{friction}" armature="{armature}"/>
<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.03" mass="{mass}"/>{inner}</body>"""


def main() -> None:
    """Draw, explain, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--arms", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    tally: dict[str, collections.Counter] = collections.defaultdict(collections.Counter)
    for number in range(arguments.arms):
        for joint, kind, outcome, text in arm(arguments.seed, number):
            group = "nothing" if kind == "nothing" else "value" if kind in VALUES else "physics"
            tally[group][outcome] += 1
            print(f"{number:3d} {joint} {kind:10s} {outcome:8s} {text}", flush=True)
    for group, counts in tally.items():
        print(f"{group}: " + ", ".join(f"{n} {name}" for name, n in counts.most_common()))


def arm(seed: int, number: int):
    """One arm: by joint the difference there, whether it was told, and what was said."""
    rng = np.random.default_rng((seed, number))
    links = drawn(rng)
    changed = None if number % 3 == 0 else int(rng.integers(6))
    kind = "nothing" if changed is None else KINDS[rng.integers(len(KINDS))]
    size = rng.uniform(0.15, 0.6)
    plant, extra = [dict(link) for link in links], {}
    if kind == "armature":  # a share of all that the joint moves
        moved = mujoco.MjModel.from_xml_string(text(links)).dof_M0
        plant[changed][kind] += size * float(moved[changed])
    elif kind in VALUES:
        plant[changed][kind] *= 1 + 2 * size
    elif changed is not None:
        # The same machine in both runs, by the top speed of a path of middling rates.
        top = 2 * np.pi * 0.7 * float(SIZES @ RATES)
        force = size * links[changed]["friction"]
        extra = {"kind": kind, "joint": changed, "size": force, "top": top}
    runs = [run(rng, text(plant), links, extra) for _ in range(2)]
    nominal = text(links)
    for i, joint in enumerate(JOINTS):
        logs = [log(ran, i) for ran in runs]
        found = jf.explain(logs[0], jf.simulators.mujoco(nominal, joint), logs[1])
        own = kind if i == changed else "nothing"
        name = f"joint/{joint}/{VALUES[own]}" if own in VALUES else ""
        truth = plant[i][own] if own in VALUES else 0.0
        yield joint, own, outcome_of(own, name, truth, found), said(found)


def drawn(rng) -> list[dict[str, float]]:
    """Six links that become lighter outwards; friction a tenth to a half of the weight's torque."""
    mass, length = float(np.exp(rng.uniform(np.log(0.5), np.log(20)))), rng.uniform(0.15, 0.6)
    links = []
    for i in range(6):
        m, reach = mass * 0.6**i, length * 0.75**i
        torque = 0.5 * 9.81 * m * reach
        share = rng.uniform(0.1, 0.5)
        friction, inertia = share * torque, m * reach**2
        links.append({
            "mass": m, "length": reach, "friction": friction, "damping": 0.3 * friction,
            "armature": 0.3 * inertia,
        })  # fmt: skip
    return links


def text(links: list[dict[str, float]]) -> str:
    """The MJCF of an arm."""
    inner = ""
    for i in reversed(range(6)):
        at = "0 0 0" if i == 0 else f"{links[i - 1]['length']} 0 0"
        inner = LINK.format(**links[i], number=i + 1, at=at, axis=AXES[i], inner=inner)
    option = '<option timestep="0.0005" integrator="implicitfast"/>'
    contact = '<default><geom contype="0" conaffinity="0"/></default>'
    return f"<mujoco>{option}{contact}<worldbody>{inner}</worldbody></mujoco>"


def run(rng, mjcf: str, links, extra, seconds: float = 20.0):
    """Time, positions and torques `(N, 6)` of a loop that follows sums of three sines."""
    plant = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(plant)
    rates, sizes = 2 * np.pi * rng.uniform(0.4, 1.0) * RATES, SIZES
    phases = rng.uniform(0, 2 * np.pi, (6, 3))
    data.qpos[:], data.qvel[:] = np.sin(phases) @ sizes, np.cos(phases) @ (sizes * rates)
    mujoco.mj_forward(plant, data)
    omega = 20 * rates[-1]
    kp, kd = plant.dof_M0 * omega**2, 2 * plant.dof_M0 * omega
    count = round(seconds / plant.opt.timestep)
    time, position, applied = np.arange(count) * plant.opt.timestep, [], []
    for now in time:
        angle = rates * now + phases
        goal, speed = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * rates)
        wanted = kp * (goal - data.qpos) + kd * (speed - data.qvel) + data.qfrc_bias
        data.qfrc_applied[:] = wanted
        if extra:
            i = extra["joint"]
            data.qfrc_applied[i] -= beyond(extra, data.qpos[i], data.qvel[i])
        position.append(data.qpos.copy())
        applied.append(wanted)
        mujoco.mj_step(plant, data)
    force = np.array(applied)
    noise = rng.uniform(0.002, 0.01) * np.sqrt(np.mean(force**2, axis=0))
    force = force + noise * rng.normal(size=force.shape)
    every, start = int(rng.integers(2, 5)), round(SETTLED / plant.opt.timestep)
    return time[start::every], np.array(position)[start::every], force[start::every]


def beyond(extra, x: float, v: float) -> float:
    """The torque that the model lacks."""
    size, top = extra["size"], extra["top"]
    return {
        "cogging": size * np.sin(2 * np.pi * x / 0.13),
        "stribeck": size * np.tanh(v / (1e-3 * top)) * np.exp(-((v / (0.1 * top)) ** 2)),
        "drag": 2 * size * v * abs(v) / top**2,
        "asymmetry": size * (v > 0) * np.tanh(v / (1e-3 * top)),
    }[extra["kind"]]


def log(ran, joint: int) -> jf.Recording:
    """The recording of one joint: 17 bits of encoder a turn, the other joints as channels."""
    time, position, force = ran
    counted = 2 * np.pi / 2**17 * np.round(position / (2 * np.pi / 2**17))
    others = {name: counted[:, i] for i, name in enumerate(JOINTS) if i != joint}
    units = {"force": "N·m", "position": "rad"}
    return jf.Recording(time, force[:, joint], counted[:, joint], channels=others, units=units)


if __name__ == "__main__":
    main()
