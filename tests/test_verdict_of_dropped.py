"""What is dropped, since the model with it is worse, may have been seen of a healthy machine."""

import pytest

from jaxfric.explanation.verdict import verdict_of


@pytest.mark.parametrize(
    ("dropped", "verdict"),
    [((), "consistent"), (("disturbance_pulses",), "consistent"), (("cogging",), "unexplained"),
     (("disturbance_pulses", "cogging"), "unexplained")],
)  # fmt: skip
def test_pulses_that_make_the_model_worse_are_no_structure(dropped, verdict):
    assert verdict_of([], [], [], False, False, [], dropped) == verdict
    assert verdict_of([], [], [], True, False, [], dropped) == "unexplained"
