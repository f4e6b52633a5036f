"""A table of time and force alone whose force is along a recorded motion, sample by sample."""

import numpy as np

from .recording import Recording

# Stamps of one sample, however many digits they have, are closer to each other than to the next.
_SAME_SAMPLE = 0.5


def motion_of(log: Recording, time: np.ndarray, source: str) -> dict[str, np.ndarray]:
    """The motion of a recording for a table with its time stamps, s, `(N,)`; roles to signals.

    **Raises:** `ValueError` if the table has other samples.
    """
    remedy = (
        f"Write the simulator's force at each sample of {log.source}, with its time stamp, or the "
        "position of each row beside it (--columns position=NAME)."
    )
    if len(time) != log.num_samples:
        raise ValueError(
            f"{source}: there is no position or velocity, and {len(time)} samples are not the "
            f"{log.num_samples} of {log.source}. {remedy}"
        )
    ours = np.asarray(log.time, float)
    apart = np.abs(np.asarray(time, float) - ours)
    if np.max(apart) > _SAME_SAMPLE * np.median(np.diff(ours)):
        raise ValueError(
            f"{source}: there is no position or velocity, and the time stamps are up to "
            f"{np.max(apart):.4g} s off those of {log.source}. {remedy}"
        )
    signals = {"position": log.position, "velocity": log.velocity}
    return {role: np.asarray(x) for role, x in signals.items() if x is not None}
