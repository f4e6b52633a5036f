"""What real recordings are explained by, beside what their authors or another measurement say.

    python benchmarks/real_proof.py --picture cogging.png

EMPS (Janot, Gautier & Brunot 2019) with a baseline that has both directions alike: its authors
identify friction that differs between them. And a brushless motor at a tenth of a revolution a
second: its cogging has been measured independently, by holding each position and recording the
current. Nothing of either is told to `explain`. The recordings are looked for as `recordings.py`
says; what is not there is left out.
"""

import argparse
import math
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import recordings

from jaxfric import read
from jaxfric.cli import _configure
from jaxfric.explanation import explain
from jaxfric.validation.proof.writing import table

# Published with the benchmark, of inverse dynamics with direction-dependent friction, N and N·s/m.
PUBLISHED = {"coulomb+": 20.1440, "coulomb-": 20.6277, "viscous+": 166.7061, "viscous-": 240.4236}
# Orders per revolution that the map holds above a quarter of an ampere.
ORDERS = (7, 12, 14, 28, 36)
TURN = 2 * math.pi


def emps(folder: Path) -> str:
    """Friction of each direction, and the ripple, in the recording and in the held-out one."""
    names = ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
    run, held = (read(folder / "emps" / name, **recordings.EMPS) for name in names)
    found = explain(run, "symmetric-coulomb-viscous", held)
    rows = [*friction(found), ripple(found)]
    errors = [
        ("", f"{what.replace('_', ' ')}", "",
         f"{found.fit[what]['before']:.2%} before, {found.fit[what]['after']:.2%} after")
        for what in ("force_error", "holdout_force_error")
    ]  # fmt: skip
    said = ", ".join(f"{f.effect} ({f.share:.0%})" for f in found.findings)
    head = ("EMPS", "", "published", "found")
    return f"{table(head, [*rows, *errors])}\n\n{found.verdict}: {said}."


def friction(found):
    """Rows of the asymmetry: the model's values in each direction beside the published ones."""
    named = any(f.effect == "asymmetric_friction" for f in found.findings)
    slow, fast = 0.02, 0.12  # m/s, inside the recorded range
    for sign, way in (("+", 1.0), ("-", -1.0)):
        ends = [way * float(found.model.friction(way * v)) for v in (slow, fast)]
        viscous = (ends[1] - ends[0]) / (fast - slow)
        yield (
            "asymmetric_friction" if named else "**not named**", f"viscous{sign}, N·s/m",
            f"{PUBLISHED[f'viscous{sign}']:.1f}", f"{viscous:.1f}",
        )  # fmt: skip


def ripple(found):
    """The row of the ripple: nobody has published it, but the held-out recording has it too."""
    waves = [f for f in found.findings if f.effect == "cogging"]
    if not waves:
        return "cogging", "ripple", "2.5 mm expected", "**not named**"
    pitch, size = (waves[0].parameters[name] for name in ("pitch", "amplitude"))
    text = f"{1e3 * float(pitch.value):.4f} ± {1e3 * float(pitch.half_width()):.4f} mm, "
    text += f"{float(size.value):.2f} N; share held out {waves[0].holdout_share or 0:.0%}"
    return "cogging", "ripple", "2.5 mm expected", text


def spectrum(position, current, orders=ORDERS):
    """`{k: (A, φ)}` of waves A sin(k x + φ) of some orders, fitted together with a constant."""
    waves = [wave(k * position) for k in orders for wave in (np.sin, np.cos)]
    columns = np.stack([*waves, np.ones_like(position)], axis=1)
    sines = np.linalg.lstsq(columns, current, rcond=None)[0][:-1].reshape(-1, 2)
    return {
        k: (float(np.hypot(*w)), math.atan2(w[1], w[0])) for k, w in zip(orders, sines, strict=True)
    }


def waves(findings, middle):
    """Orders found, each with amplitude, standard error and phase (of A sin(k x + φ)) in A and rad.

    A pitch is found to a few thousandths: the phase is that in the `middle` of the recording, where
    it is best determined.
    """
    found = {}
    for finding in findings:
        if finding.effect != "cogging":
            continue
        pitch = float(finding.parameters["pitch"].value)
        for name, size in finding.parameters.items():
            if not name.startswith("amplitude"):
                continue
            harmonic = int(name.removeprefix("amplitude").removeprefix("_harmonic") or 1)
            order = round(TURN * harmonic / pitch)
            phase = float(finding.parameters[name.replace("amplitude", "phase")].value)
            phase += (TURN * harmonic / pitch - order) * middle
            if order not in found or float(size.value) > found[order][0]:
                found[order] = float(size.value), float(size.standard_error), phase
    return found


def degrees(angle: float) -> float:
    """An angle, rad, as degrees from −180 to 180."""
    return math.degrees((angle + math.pi) % TURN - math.pi)


def compared(known, log, found):
    """Rows: order, the map, the current of the run by a Fourier fit, what was found."""
    for order, (size, phase) in sorted(known.items(), key=lambda item: -item[1][0]):
        plain = f"{log[order][0]:.2f} A, {degrees(log[order][1] - phase):+.0f}°"
        text = "not found"
        if order in found:
            amplitude, error, at = found[order]
            text = f"{amplitude:.2f} ± {2 * error:.2f} A, {degrees(at - phase):+.0f}°"
        yield str(order), f"{size:.2f} A", plain, text


def odrive(folder: Path, name: str, picture: str | None) -> str:
    """Cogging of the slow run beside the map."""
    log = read(folder / "odrive" / f"{name}.csv", **recordings.ODRIVE)
    map_ = np.genfromtxt(folder / "odrive" / "measured_cogging_map.csv", delimiter=",", names=True)
    angle, held = map_["position_counts"] * TURN / recordings.TURN, map_["current"]
    x, current = np.asarray(log.position), np.asarray(log.force)
    found = explain(log, "coulomb-viscous")
    lines = waves(found.findings, float(x.mean()))
    known = spectrum(angle, held)
    head = (name.replace("_", " "), "by holding each position", "the run's current, Fourier",
            "found; phase against the map")  # fmt: skip
    if picture:
        draw(picture, (angle, held), (x, current), lines, known)
    errors = found.fit["force_error"]
    others = sorted({f.effect for f in found.findings} - {"cogging"})
    extra = sorted(set(lines) - set(known))
    text = (
        f"{found.verdict}; force error {errors['before']:.0%} before, {errors['after']:.0%} after"
    )
    text += f"; orders beside: {', '.join(map(str, extra)) or 'none'}"
    text += f"; other effects: {', '.join(others) or 'none'}."
    return f"{table(head, compared(known, spectrum(x, current), lines))}\n\n{text}"


def draw(file, known, log, found, orders) -> None:
    """The map, the run's current and the found waves over a revolution."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.4), layout="constrained", dpi=120)
    axes = figure.add_subplot()
    at = np.linspace(0, TURN, 2000)
    wave = sum(size * np.sin(k * at + phase) for k, (size, _, phase) in found.items())
    axes.plot(log[0], log[1] - np.mean(log[1]), color="#999999", lw=0.8, label="current of the run")
    axes.plot(known[0], known[1], color="#c4570a", lw=0.9, label="map, by holding each position")
    axes.plot(at, wave, color="#0b5fa5", lw=1.3, label=f"found, orders {sorted(found)}")
    axes.set_xlabel("position, rad")
    axes.set_ylabel("current, A")
    axes.legend(loc="lower right", fontsize=7)
    FigureCanvasAgg(figure).print_png(file)


def main() -> None:
    """Print a table for each recording that is there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", help="where to draw the motor's cogging")
    arguments = parser.parse_args()
    _configure()
    folder = recordings.folder()
    if (folder / "emps").is_dir():
        print(emps(folder), end="\n\n", flush=True)
    if (folder / "odrive").is_dir():
        print(odrive(folder, "slow_uncompensated", arguments.picture), end="\n\n", flush=True)
        print(odrive(folder, "slow_compensated", None), flush=True)
    if not folder.is_dir():
        print(f"{folder}: not there; JAXFRIC_DATA names the folder with the recordings.")


if __name__ == "__main__":
    main()
