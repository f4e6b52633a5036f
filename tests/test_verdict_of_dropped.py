"""What is dropped, since the model with it is worse, may have been seen of a healthy machine."""

import types

import pytest

from jaxfric.explanation import improvement
from jaxfric.explanation.verdict import verdict_of


@pytest.mark.parametrize(
    ("dropped", "verdict"),
    [((), "consistent"), (("disturbance_pulses",), "consistent"), (("cogging",), "unexplained"),
     (("disturbance_pulses", "cogging"), "unexplained")],
)  # fmt: skip
def test_pulses_that_make_the_model_worse_are_no_structure(dropped, verdict):
    assert verdict_of([], [], [], False, False, [], dropped) == verdict
    assert verdict_of([], [], [], True, False, [], dropped) == "unexplained"


@pytest.mark.parametrize(
    ("name", "left", "noise"),
    [("compliance", 0.75, True), ("compliance", 0.4, False), ("cogging", 0.75, False),
     ("parameter_mismatch", 0.75, False)],
)  # fmt: skip
def test_what_follows_the_acceleration_may_be_the_encoder_s_noise(name, left, noise):
    """Which the controller answers: it is a quarter of a residual at most."""

    def findings(energy, *names):
        selected = [types.SimpleNamespace(effect=types.SimpleNamespace(name=n)) for n in names]
        selection = types.SimpleNamespace(selected=selected, last=types.SimpleNamespace())
        selection.last.energy = energy
        return types.SimpleNamespace(
            undelayed=types.SimpleNamespace(selection=selection),
            without=lambda number: findings(1.0),
        )

    assert improvement._as_noise(name, findings(left, name)) is noise
