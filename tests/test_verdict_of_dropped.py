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
    ("swings", "left", "noise"), [(True, 0.75, True), (True, 0.4, False), (False, 0.75, False)]
)
def test_a_load_that_swings_may_be_the_encoder_s_noise(swings, left, noise):
    """Which the controller answers: it is a quarter of a residual at most."""
    simple = types.SimpleNamespace
    candidate = simple(term=simple(swings=swings))
    one = simple(effect=simple(name="load"), trial=simple(candidate=candidate))

    def findings(energy, *selected):
        selection = simple(selected=selected, last=simple(energy=energy))
        return simple(undelayed=simple(selection=selection), without=lambda number: findings(1.0))

    assert improvement._as_noise("load", findings(left, one)) is noise
    assert not improvement._as_noise("parameter_mismatch", findings(left, one))
