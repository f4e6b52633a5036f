"""Section IV of Kim, Kim & Ha (2004) on our own machine: table, curves, and problem (P).

    python benchmarks/paper_table.py

Prints the parameters (true, ACVM, AGM, ALM) of one noise-free period, then the error of the
friction curve of (L) and (P) over noise, encoder and record (minutes: many
compilations). The figures: `paper_figures.py`.
"""

import argparse

import jax
from problem_p import curve_distance, curve_error, problem_p

from jaxfric.identification.identifying import identify
from jaxfric.simulation import scenario
from jaxfric.simulation.control import Encoder

MODELS = {"ACVM": "coulomb-viscous", "AGM": "gaussian", "ALM": "lorentzian"}
LOW, HIGH = 0.002, 0.18


def parameter_table(fits):
    print(f"{'parameter':<20}{'true':>10}" + "".join(f"{name:>22}" for name in fits))
    for name, value in scenario.TRUTH.items():
        print(f"{name:<20}{value:>10.4g}" + "".join(_cell(fit, name) for fit in fits.values()))
    for low, high in ((1e-4, 0.01), (0.01, 0.04), (0.04, 0.18)):
        errors = (curve_distance(f.model, scenario.machine(), low, high) for f in fits.values())
        label = f"curve, N, {low:g}-{high:g} m/s"
        print(f"{label:<30}" + "".join(f"{error:>22.4f}" for error in errors))


def _cell(fit, name):
    estimate = fit.parameters.get(name)
    if estimate is None:
        return f"{'-':>22}"
    return f"{float(estimate.value):>12.5g} ± {float(estimate.standard_error):<7.2g}"


def comparison():
    """RMS error of the friction curve, N, of ALM by (L) and by (P) with several masses."""
    truth = scenario.machine()
    start = [scenario.TRUTH["stribeck_velocity+"], scenario.TRUTH["stribeck_velocity-"]]
    masses = {"unknown": None, "known": 5.0, "20 % high": 6.0}
    head = "".join(f"{'(P) ' + name:>16}" for name in masses)
    print(f"\n{'recording':<34}{'(L)':>10}{head}{'(P) mass, kg':>14}")
    for noise in (0.0, 0.5):
        for resolution in (None, 1e-7, 1e-6, 5e-6):
            encoder = None if resolution is None else Encoder(resolution)
            key = jax.random.key(1)
            whole = scenario.record(truth, 1, encoder, noise, key)
            for label, share in (("period", 1.0), ("85 %", 0.85)):
                count = round(share * whole.num_samples)
                recording = jax.tree.map(lambda x, n=count: x[:n], whole)
                found = identify("lorentzian", recording)
                rows = [problem_p(truth.term, recording, start, m) for m in masses.values()]
                errors = [curve_error(row, truth, LOW, HIGH) for row in rows]
                name = f"{label}, {noise} N, encoder {resolution or 'ideal'}"
                mine = curve_distance(found.model, truth, LOW, HIGH)
                cells = "".join(f"{error:>16.4f}" for error in errors)
                print(f"{name:<34}{mine:>10.4f}{cells}{rows[0]['inertia']:>14.3f}")


def main():
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    jax.config.update("jax_enable_x64", True)
    recording = scenario.record(scenario.machine())
    fits = {short: identify(name, recording) for short, name in MODELS.items()}
    parameter_table(fits)
    comparison()


if __name__ == "__main__":
    main()
