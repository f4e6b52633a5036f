"""Values that are others on the held-out recording, and that this one would show."""

import types

import numpy as np

from jaxfric import models
from jaxfric.explanation import errors, evidence
from jaxfric.explanation.regression import fit

from .test_explain import healthy as healthy


def test_of_a_bump_narrower_than_its_slowest_row_a_recording_says_nothing(healthy):
    """Rows of a fast move see nothing of it, whatever their own bump stands in for."""
    rows = evidence.gather(healthy[0].__class__(*_plain(healthy[0])))
    slow = np.abs(np.asarray(rows.motion.velocity)[rows.centre])
    fast = rows.only(slow > 0.1)
    term = models.gaussian()
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    for seen, shows in ((rows, True), (fast, False)):
        here = fit([term], seen, [np.array([0.05, 0.05])], 0)
        there = here._replace(
            alphas=(np.array([5.0, 22.0, 66.0, 9.0, 18.0, 54.0, 9.0]),),
            betas=(np.array([0.01, 0.01]),),
        )
        solution = types.SimpleNamespace(
            problem=types.SimpleNamespace(evidence=seen), selection=types.SimpleNamespace(last=here)
        )
        shown = dict(zip(names, errors._shown(solution, there), strict=True))
        for name in ("stribeck_force+", "stribeck_velocity-"):
            assert shown[name] == shows, (name, slow.min())
        assert shown["inertia"] and shown["coulomb-"]


def _plain(recording):
    return recording.time, recording.force, recording.position
