"""`jaxfric simulate`: a model run forward."""

from argparse import Namespace

import numpy as np

from ..simulation import control
from ..simulation.simulating import simulate
from . import benefit
from .commands import in_units, load_model, put_table, read, stated


def run(arguments: Namespace) -> int:
    """`jaxfric simulate`: motion and force of a model, as a table."""
    model = load_model(arguments.model)
    controller = None
    if arguments.controller:
        kinds = {"pd": control.PD, "pid": control.PID, "cascade": control.Cascade}
        kind, gains = arguments.controller
        controller = kinds[kind](**gains)
    reference, notes = read(arguments.file, arguments, set_point=True)
    reference = in_units(reference, model, arguments)
    if arguments.compensate is not None:
        return benefit.simulated(model, reference, controller, notes, arguments)
    if arguments.json:
        raise ValueError("--json holds the benefit of --compensate, which is not given.")
    if controller is None and not np.any(np.asarray(reference.force)):
        raise ValueError(
            f"{arguments.file}: no force drives the axis. Name the column (--columns force=NAME) "
            "or follow a set-point (--controller pd:kp=…,kd=…)."
        )
    try:
        run = simulate(model, reference, controller)
    except ValueError as error:
        raise ValueError(f"{arguments.model}, {arguments.file}: {error}") from error
    if not np.all(np.isfinite(np.asarray(run.position))):
        raise ValueError(
            f"{arguments.file}: the simulated motion grows without bound. Check the gains and "
            "the sample rate (a gain must act slower than the clock) and the model's units."
        )
    columns = {"time": run.time, "force": run.force, "position": run.position}
    if run.velocity is not None:
        columns["velocity"] = run.velocity
    notes = [stated(run), *notes]
    put_table(arguments.out, columns | run.channels, notes, f"{run.num_samples} samples")
    return 0
