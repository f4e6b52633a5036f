"""The predicted benefit of compensation, on machines whose true benefit is known."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import PD, Recording, models
from jaxfric.cli import main
from jaxfric.cli.benefit import of_explanation
from jaxfric.data import io
from jaxfric.report import content
from jaxfric.simulation.compensation import OPTIMISTIC, benefit

TIME = jnp.asarray(np.arange(4001) / 1000)
GOAL = 0.05 * (1 - jnp.cos(np.pi * TIME))
VALUES = {"inertia": 5.0, "coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 20.0, "viscous-": 60.0}
LOOP = PD(kp=20_000.0, kd=600.0)


def machine(**other):
    return models.from_parameters(models.coulomb_viscous(), VALUES | other)


def reference():
    return Recording(time=TIME, force=jnp.zeros_like(TIME), position=GOAL)


@pytest.mark.slow
def test_the_whole_force_goes_with_the_machines_own_model():
    found = benefit(machine(), reference(), LOOP)
    assert found.error_removed > 0.95 and found.force_removed > 0.95
    assert found.run.channels["compensation"].shape == TIME.shape


@pytest.mark.slow
def test_what_is_left_is_what_the_drive_does_not_know():
    """Slow motion: the controller bears the missing Coulomb force, and the error is that by kp."""
    lacking = machine(**{"coulomb+": 12.0, "coulomb-": 12.0})
    found = benefit(machine(), reference(), LOOP, lacking)
    assert found.compensated.force == pytest.approx(8.0, rel=0.05)
    assert found.compensated.error == pytest.approx(8.0 / 20_000, rel=0.05)
    # Alone it bears all of it, the velocity's part included (kd acts on the velocity's error).
    slip = 20 + 60 * 0.05 * np.pi * np.abs(np.sin(np.pi * TIME))
    mass = 5 * 0.05 * np.pi**2 * np.cos(np.pi * TIME) * np.sign(np.sin(np.pi * TIME))
    alone = np.sqrt(np.mean((slip + mass) ** 2))
    assert found.without.force == pytest.approx(alone, rel=0.05)
    assert found.error_removed == pytest.approx(1 - 8 / alone, abs=0.03)


def test_a_wrong_model_that_does_harm_is_told():
    found = benefit(machine(), reference(), LOOP, machine(**{"coulomb+": 70.0, "coulomb-": 70.0}))
    assert found.error_removed < 0 and found.force_removed < 0


def test_interruptions_are_refused():
    parts = jnp.where(TIME < 2, 0, 1)
    log = Recording(time=TIME, force=0 * TIME, position=GOAL, segment=parts)
    with pytest.raises(ValueError, match="interruptions"):
        benefit(machine(), log, LOOP)


def test_the_command_says_what_goes_and_what_is_assumed(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    names = ("m.json", "ref.csv", "out.csv", "benefit.json")
    model, log, out, document = (str(tmp_path / name) for name in names)
    (tmp_path / "m.json").write_text(json.dumps(machine().to_dict()))
    io.write_table(log, {"time": TIME, "reference": GOAL})
    line = ["simulate", model, log, "--compensate", "-o", out, "--json", document]
    assert main(line) == 0
    printed = capsys.readouterr().out
    assert "tracking error" in printed and "Assumed: the machine is this model" in printed
    assert "pd:kp=50000,kd=1000" in printed  # a double pole at 100 rad/s of 5 kg
    assert printed.rstrip().endswith(OPTIMISTIC)
    found = json.loads((tmp_path / "benefit.json").read_text())
    assert found["schema"] == "jaxfric.benefit/1" and found["error_removed"] > 0.9
    table = np.genfromtxt(out, delimiter=",", names=True)
    left = np.sqrt(np.mean((table["position"] - np.asarray(GOAL)) ** 2))
    assert left == pytest.approx(found["compensated"]["error"], rel=1e-6)
    other = tmp_path / "other.json"
    other.write_text(json.dumps(machine(**{"coulomb+": 12.0}).to_dict()))
    assert main(["simulate", model, log, "--compensate", str(other), "-o", out]) == 0
    assert OPTIMISTIC not in capsys.readouterr().out
    assert main(["simulate", model, log, "-o", out, "--json", document]) == 2
    assert "--compensate" in capsys.readouterr().err


def test_export_says_what_feed_forward_would_be_worth(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    model, log = str(tmp_path / "m.json"), str(tmp_path / "ref.csv")
    (tmp_path / "m.json").write_text(json.dumps(machine().to_dict()))
    io.write_table(log, {"time": TIME, "reference": GOAL})
    line = ["export", model, "--to", "c", "-o", str(tmp_path / "axis.c"), "--reference", log]
    assert main(line) == 0
    said = capsys.readouterr().out
    found = benefit(machine(), reference())
    assert f"{found.without.error:.3g} m rms without" in said, said
    assert f"{found.error_removed:.0%} removed" in said
    assert "with pd:kp=50000,kd=1000" in said and OPTIMISTIC in said


def test_an_explanation_compares_feed_forward_by_both_models():
    lacking = machine(**{"coulomb+": 12.0, "coulomb-": 12.0})
    log = Recording(time=TIME, force=0 * TIME, position=GOAL, channels={"reference": GOAL})
    found = of_explanation(lacking, machine(), log)
    without, by_both = found["improved"]["without"], found["improved"]["compensated"]
    assert without["error"] > found["baseline"]["compensated"]["error"] > by_both["error"]
    document = {"benefit": found}
    rows = content.benefit(document, {"force": "N", "position": "m"})
    assert [name for name, *_ in rows][1:] == ["by the baseline", "by the improved model"]
    assert rows[0][1] == f"{without['error']:.3g} m"
    assert of_explanation(lacking, machine(), reference()) is None  # no set-point is known
    assert content.benefit({}, {}) == []
