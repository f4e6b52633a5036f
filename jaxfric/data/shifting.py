"""A signal taken earlier or later."""

import numpy as np
from jaxtyping import Float, Shaped


def shifted(
    time: Float[np.ndarray, " N"],
    signal: Float[np.ndarray, " N"],
    run: Shaped[np.ndarray, " N"],
    by: float,
) -> Float[np.ndarray, " N"]:
    """A signal at t + `by`, straight between the samples of a run, held at its ends.

    **Arguments:** `time`, s, increasing inside each run; `signal` of any unit; `run`, labels of the
    samples that belong together; `by`, s. All `(N,)`, on the host.
    """
    found = np.empty_like(signal)
    for label in np.unique(run):
        own = run == label
        found[own] = np.interp(time[own] + by, time[own], signal[own])
    return found
