"""A single joint in MuJoCo (extra package `mujoco`): someone else's physics altogether."""

import numpy as np
from numpy.random import Generator

from . import motions
from .logs import PLAIN, TRUE_VELOCITY, Log, Pair, log_uniform

SAMPLES = 4000

XML = """
<mujoco><option timestep="{step!r}" integrator="implicitfast" gravity="0 0 0">
<flag contact="disable"/></option><worldbody><body>
<joint name="axis" type="hinge" axis="0 0 1" armature="{mass!r}" damping="{viscous!r}"
 frictionloss="{coulomb!r}" solimpfriction="0.999 0.9999 0.001 0.5 2"
 solreffriction="{soft!r} 1"/>
<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>
</body></worldbody><actuator><motor joint="axis"/></actuator></mujoco>
"""


def draw(rng: Generator) -> Pair:
    """A hinge under feedback of its state, and two runs of it."""
    cycle, rate = log_uniform(rng, 80, 250), log_uniform(rng, 200, 2000)
    time = np.arange(SAMPLES) / rate
    goals = [motions.s_curves(rng, time, rate / cycle) for _ in range(2)]
    stroke, coulomb = log_uniform(rng, 0.05, 5.0), log_uniform(rng, 0.1, 100.0)
    goals = [stroke * (each - each.min()) / np.ptp(each) for each in goals]
    wanted = np.gradient(goals[0], time)
    speed = float(np.quantile(np.abs(wanted), 0.98))
    hard = float(np.quantile(np.abs(np.gradient(wanted, time)), 0.98))
    mass = coulomb / hard * log_uniform(rng, 0.3, 3.0)
    viscous = coulomb / speed * log_uniform(rng, 0.15, 1.0)
    finer = 5
    step = 1 / (rate * finer)
    xml = XML.format(step=step, mass=mass, viscous=viscous, coulomb=coulomb, soft=2 * step)
    omega = 2 * np.pi * rate / cycle * 5
    columns = [_run(rng, xml, goal, time, mass, omega, finer, coulomb) for goal in goals]
    truth = {"inertia": mass}
    for sign in "+-":
        truth |= {f"coulomb{sign}": coulomb, f"viscous{sign}": viscous}
    names = dict(PLAIN[rng.integers(len(PLAIN))], reference="reference")
    machine = f"joint: MuJoCo hinge, {rate:.4g} Hz, {cycle:.3g} samples a cycle"
    return Pair(
        *(Log(c, names, truth, speed, hard, cycle, "coulomb-viscous", machine) for c in columns)
    )


def _run(rng, xml, goal, time, mass, omega, finer, coulomb) -> dict[str, np.ndarray]:
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    wanted = np.gradient(goal, time)
    data.qpos[0], data.qvel[0] = goal[0], wanted[0]
    ahead = mass * np.gradient(wanted, time)
    rows = []
    for place, speed, known in zip(goal, wanted, ahead, strict=True):
        x, v = float(data.qpos[0]), float(data.qvel[0])
        force = mass * omega * (omega * (place - x) + 2 * (speed - v)) + known
        data.ctrl[0] = force
        rows.append((x, v, force))
        mujoco.mj_step(model, data, finer)
    x, v, force = np.array(rows).T
    # The force is held from its sample to the next: the mean of both neighbours is centred.
    force = 0.5 * (force + np.append(force[0], force[:-1]))
    count = np.ptp(goal) / log_uniform(rng, 1e4, 1e6)
    blur = log_uniform(rng, 0.003, 0.02) * coulomb * rng.normal(size=time.size)
    return {
        "time": time, "position": count * np.round(x / count), "velocity": v,
        "force": force + blur, "reference": goal, TRUE_VELOCITY: v,
    }  # fmt: skip
