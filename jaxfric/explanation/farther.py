"""Where a held-out recording goes that the recording itself does not."""

import numpy as np

from .problem import Problem

# What a law was not seen in, by a tenth of the stroke or of the speed, it may not hold for.
FARTHER = 0.1


def farther(problem: Problem) -> str:
    """Where and how fast the held-out recording moves and the recording itself does not, a sentence
    with a space before it; empty where that is under a tenth.
    """
    here, held, units = problem.evidence, problem.held, problem.evidence.motion.unit_names
    if held is None:
        return ""
    own, other, length = here.limits, held.limits, units["position"]
    said, beyond = [], FARTHER * (own.high - own.low)
    if (
        here.located
        and held.located
        and (other.low < own.low - beyond or other.high > own.high + beyond)
    ):
        ranges = [f"{each.low:.4g} to {each.high:.4g} {length}" for each in (other, own)]
        said.append(f"goes from {ranges[0]}, this one from {ranges[1]}")
    # `fastest` leaves out the fastest samples, which have shown what acts at their speeds.
    reached = float(np.nanmax(np.abs(np.asarray(here.motion.velocity)[: here.nodes])))
    if other.fastest > (1 + FARTHER) * reached:
        said.append(f"moves at {other.fastest:.3g} {length}/s, this one at up to {reached:.3g}")
    if not said:
        return ""
    return f" It {', and '.join(said)}: what acts only there this one does not show."
