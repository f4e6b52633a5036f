"""Machines drawn in MuJoCo, explained from a nominal MuJoCo model: what is said of the difference.

    python benchmarks/mujoco_proof.py --cases 60 --seed 1

Single joints, turning and sliding, and both joints of two-link arms, under PD control of their own
gains, with encoder counts and force noise. The plant differs from the model by nothing, by one
value, or by physics that the model lacks. Needs MuJoCo.
"""

import argparse
import collections
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import mujoco
import numpy as np

import jaxfric as jf
from jaxfric.export import patch as patching

ARM = """<mujoco><option timestep="{step}" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="first" type="{kind}" axis="{axis}" damping="{damping}"
 frictionloss="{friction}" armature="{armature}" stiffness="{stiffness}"/>
<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.02" mass="{mass}"/>{second}</body>
</worldbody></mujoco>"""
SECOND = """<body name="fore" pos="{length} 0 0"><joint name="second" axis="0 1 0"
 damping="{damping2}" frictionloss="{friction2}" armature="{armature2}"/>
<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.02" mass="{mass2}"/></body>"""

JOINTS = ("first", "second")
# What is done to the plant, and how a right answer names it: wrong values, or an effect.
VALUES = {
    "damping": "joint/first/damping",
    "friction": "joint/first/frictionloss",
    "armature": "joint/first/armature",
    "gain": "gain",
    "stiffness": "joint/first/stiffness",
    "mass": "body/upper/mass",
    "damping2": "joint/second/damping",
    "mass2": "body/fore/mass",
}
EFFECTS = {
    "cogging": {"cogging", "gravity_unbalance", "position_dependent_friction"},
    "stribeck": {"stribeck", "viscous_nonlinearity"},
    "drag": {"viscous_nonlinearity", "stribeck"},
    "delay": {"transport_delay", "actuator_lag"},
    "asymmetry": {"asymmetric_friction", "gain_asymmetry"},
}
# What a tracking error may differ by from the machine's own.
NEAR = 0.1


def main() -> None:
    """Draw, explain, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    tally: dict[str, collections.Counter] = collections.defaultdict(collections.Counter)
    again, inside = collections.Counter[str](), collections.Counter[bool]()
    for number in range(arguments.cases):
        for kind, outcome, text, ratio, away in case(arguments.seed, number):
            tally[kind][outcome] += 1
            if away is not None:
                inside[away <= 1] += 1
                text += f"; {away:.1f} half intervals from the truth"
            if kind != "nothing":
                again["no" if ratio is None else "near" if abs(ratio - 1) <= NEAR else "off"] += 1
                text += "; not run again" if ratio is None else f"; tracking error × {ratio:.2f}"
            print(f"{number:3d} {kind:10s} {outcome:8s} {text}", flush=True)
    for kind, counts in tally.items():
        print(f"{kind}: " + ", ".join(f"{n} {name}" for name, n in counts.most_common()))
    print(
        f"tracking error of the written model, run again: within {NEAR:.0%} of the machine's in "
        f"{again['near']}, not in {again['off']}, not run in {again['no']}"
    )
    print(f"95 % intervals of wrong values: the truth is in {inside[True]} of {inside.total()}")


def case(seed: int, number: int):
    """One machine: the kind of difference, whether it was told, and what was said, by joint."""
    rng = np.random.default_rng((seed, number))
    kinds = ["damping", "friction", "armature", "gain", "stiffness", *EFFECTS]
    kind = "nothing" if number % 3 == 0 else kinds[rng.integers(len(kinds))]
    kind = "mass" if kind == "friction" and number % 2 else kind
    two = bool(rng.random() < 0.4)
    # Of an arm what its second joint carries.
    kind = f"{kind}2" if two and kind in ("damping", "mass") and number % 4 > 1 else kind
    values = draw(rng, two)
    plant, extra = dict(values), {}
    size = rng.uniform(0.15, 0.6)
    friction = values["friction"]
    if kind == "gain":
        extra["gain"] = 1 + size / 2
    elif kind == "stiffness":
        plant["stiffness"] = size * values["stiff"]
    elif kind in VALUES:
        plant[kind] = values[kind] * (1 + 2 * size)
    elif kind in EFFECTS:
        extra[kind] = size * friction if kind != "delay" else 0.004 + 0.006 * size
    runs = [run(rng, model(plant), values, extra, two) for _ in range(2)]
    nominal = model(values)
    simulators = [jf.simulators.mujoco(nominal, name) for name in JOINTS[: 1 + two]]
    for joint in range(1 + two):
        if kind != "nothing" and joint != kind.endswith("2"):
            continue  # what was changed is the other joint's
        logs = [log(r, joint, two, values) for r in runs]
        found = jf.explain(logs[0], simulators[joint], logs[1])
        ratio = run_again(nominal, simulators, JOINTS[joint], found, logs, runs[0], values)
        away = None if kind not in VALUES else distance(kind, plant, extra, found)
        name = VALUES.get(kind, "")
        truth = truth_of(kind, plant, extra) if name else 0.0
        yield kind, outcome_of(kind, name, truth, found), said(found), ratio, away


def run_again(nominal: str, simulators, joint: str, found, logs, ran, values) -> float | None:
    """The tracking error of the model with what was found, over the machine's own; `None` where
    the closed loop cannot be run again.
    """
    if not found.findings:
        return None
    names, two = JOINTS[: len(simulators)], len(simulators) > 1
    again = patching.Again(
        dict(zip(names, simulators, strict=True)),
        {name: log(ran, i, two, values) for i, name in enumerate(names)},
        {name: ran[3][:, i] for i, name in enumerate(names)},
    )
    done = patching.patch(nominal, {joint: found}, {joint: logs}, "new.xml", again)
    for row in done.rerun.errors():
        if row["joint"] == joint:
            return row["tracking_error"]["after"] / row["tracking_error"]["recorded"]
    return None


def draw(rng, two: bool) -> dict:
    """A machine: masses from 50 g to 20 kg, friction a tenth to a half of the other forces."""
    slide = not two and rng.random() < 0.4
    mass, length = float(np.exp(rng.uniform(np.log(0.05), np.log(20)))), rng.uniform(0.1, 0.6)
    rate = rng.uniform(0.5, 2.0)  # Hz of the fastest wave
    reach = rng.uniform(0.3, 0.9) * (length if slide else 1.0)
    inertia = mass * (1.0 if slide else length**2 / 3)
    force = inertia * reach * (2 * np.pi * rate) ** 2 * 0.2 + (
        0 if slide else 0.5 * mass * 9.81 * length
    )
    speed = reach * 2 * np.pi * rate * 0.4
    share = rng.uniform(0.1, 0.5)
    return {
        "step": 0.0005, "kind": "slide" if slide else "hinge", "slide": slide, "mass": mass,
        "axis": "1 0 0" if slide else "0 1 0", "length": length, "rate": rate, "reach": reach,
        "damping": 0.5 * share * force / speed, "friction": share * force,
        "armature": 0.1 * inertia, "stiffness": 0.0, "stiff": force / reach, "force": force,
        "mass2": 0.5 * mass, "damping2": 0.1 * share * force / speed,
        "friction2": 0.2 * share * force, "armature2": 0.05 * inertia, "two": two,
        "every": int(rng.integers(2, 8)),
    }  # fmt: skip


def model(values: dict) -> str:
    """The MJCF of a machine."""
    second = SECOND.format(**values) if values["two"] else ""
    return ARM.format(**values, second=second)


def run(rng, text: str, values: dict, extra: dict, two: bool, seconds: float = 15.0):
    """Time, positions `(N, joints)`, forces and references of a closed loop."""
    plant = mujoco.MjModel.from_xml_string(text)
    data, joints = mujoco.MjData(plant), 1 + two
    rates = 2 * np.pi * values["rate"] * np.array([0.23, 0.54, 1.0])
    sizes = values["reach"] * np.array([0.5, 0.25, 0.1])
    phases = rng.uniform(0, 2 * np.pi, (joints, 3))
    data.qpos[:], data.qvel[:] = np.sin(phases) @ sizes, np.cos(phases) @ (sizes * rates)
    mujoco.mj_forward(plant, data)
    # A loop that waits for its force has to be slower.
    omega = min(40 * np.pi * values["rate"], 0.15 / extra.get("delay", 1e-3))
    kp, kd = plant.dof_M0 * omega**2, 2 * plant.dof_M0 * omega
    count = round(seconds / plant.opt.timestep)
    time, position, force, goals = np.arange(count) * plant.opt.timestep, [], [], []
    late = collections.deque([None] * (1 + round(extra.get("delay", 0.0) / plant.opt.timestep)))
    for now in time:
        angle = rates * now + phases
        goal, speed = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * rates)
        wanted = kp * (goal - data.qpos) + kd * (speed - data.qvel) + data.qfrc_bias
        late.append(wanted)
        late.popleft()
        acting = wanted if late[0] is None else late[0]
        data.qfrc_applied[:] = acting
        data.qfrc_applied[0] += beyond(extra, data.qpos[0], data.qvel[0], values)
        position.append(data.qpos.copy())
        goals.append(goal)
        force.append(wanted)
        mujoco.mj_step(plant, data)
    force = extra.get("gain", 1.0) * np.array(force)
    noise = rng.uniform(0.002, 0.01) * np.sqrt(np.mean(force**2, axis=0))
    every = values["every"]
    return (
        time[::every],
        np.array(position)[::every],
        (force + noise * rng.normal(size=force.shape))[::every],
        np.array(goals)[::every],
    )


def beyond(extra: dict, x: float, v: float, values: dict) -> float:
    """The force on the first joint that the model lacks."""
    top = values["reach"] * 2 * np.pi * values["rate"] * 0.4
    if "cogging" in extra:
        return -extra["cogging"] * np.sin(2 * np.pi * x / (0.13 * values["reach"]))
    if "stribeck" in extra:
        return -extra["stribeck"] * np.tanh(v / (1e-3 * top)) * np.exp(-((v / (0.1 * top)) ** 2))
    if "drag" in extra:
        return -2 * extra["drag"] * v * abs(v) / top**2
    if "asymmetry" in extra:
        return -extra["asymmetry"] * (v > 0) * np.tanh(v / (1e-3 * top))
    return 0.0


def log(ran, joint: int, two: bool, values: dict) -> jf.Recording:
    """The recording of one joint: 17 bits of encoder a turn or a reach, the other as a channel."""
    time, position, force, _ = ran
    count = (values["reach"] if values["slide"] else 2 * np.pi) / 2**17
    counted = count * np.round(position / count)
    others = {JOINTS[1 - joint]: counted[:, 1 - joint]} if two else {}
    units = (
        {"force": "N", "position": "m"} if values["slide"] else {"force": "N·m", "position": "rad"}
    )
    return jf.Recording(time, force[:, joint], counted[:, joint], channels=others, units=units)


def outcome_of(kind: str, name: str, truth: float, found) -> str:
    """Right, biased, declared (among what cannot be told apart), beside, or wrong.

    `name` of the attribute that has another value, the `truth`; none where it is physics.
    """
    effects = {finding.effect for finding in found.findings}
    near = {name for finding in found.findings for name in finding.confusable_with}
    if kind == "nothing":
        return "right" if found.verdict == "consistent" else "wrong"
    if name:
        return _valued(name, truth, effects, found)
    if EFFECTS[kind] & effects:
        return "right" if effects <= EFFECTS[kind] | {"parameter_mismatch"} else "beside"
    return "declared" if EFFECTS[kind] & near else "wrong"


def truth_of(kind: str, plant: dict, extra: dict) -> float:
    """The right value of what is wrong.

    The plant's damping acts at the end of each step (implicit integration), so that it moves like
    one whose armature is larger by damping times step.
    """
    more = plant["damping"] * plant["step"] if kind == "armature" else 0.0
    return extra["gain"] if kind == "gain" else plant[kind] + more


def distance(kind: str, plant: dict, extra: dict, found) -> float | None:
    """By how many halves of its interval a value is off; `None` where it was not found."""
    for finding in found.findings:
        if VALUES[kind] in finding.parameters:
            value = finding.parameters[VALUES[kind]]
            away = abs(float(value.value) - truth_of(kind, plant, extra))
            return away / float(value.half_width())
    return None


def _valued(name: str, truth: float, effects: set, found) -> str:
    """Right; biased, beyond its interval; declared, as what this motion cannot tell from it."""
    if effects != {"parameter_mismatch"}:
        return "wrong" if "parameter_mismatch" not in effects else "beside"
    (finding,) = found.findings
    if set(finding.parameters) != {name}:
        alone = len(finding.parameters) == 1
        near = {other for others in finding.instead.values() for other in others}
        kind, _, what = name.partition("/")
        owner, _, what = what.partition("/")
        same = f"{what} of {kind} {owner}" in finding.sentence
        return "declared" if alone and (name in near or same) else "beside"
    (value,) = finding.parameters.values()
    away = abs(float(value.value) - truth)
    moved = abs(truth - value.before)
    return "right" if away <= float(value.half_width()) + 0.02 * moved else "biased"


def said(found) -> str:
    """The verdict, the names, and the filtered errors held out."""
    names = [
        f.effect if f.effect != "parameter_mismatch" else "+".join(f.parameters)
        for f in found.findings
    ]
    held = found.fit["filtered_holdout_force_error"]
    return (
        f"{found.verdict}: {', '.join(names) or '-'} ({held['before']:.2%} → {held['after']:.2%})"
    )


if __name__ == "__main__":
    main()
