"""Logs in German, French, Chinese and Japanese; logs without a clock; what somebody meant."""

import io
import subprocess
import sys

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.cli import main
from jaxfric.cli.commands import working
from jaxfric.cli.examples import EXAMPLES
from jaxfric.data.io import read_with_notes
from jaxfric.data.languages import english
from jaxfric.data.nearest import meant
from jaxfric.data.roles import describe

from .test_cli import write_axis

NAMES = {
    "time": "Zeit [s]|Zeitstempel|temps (s)|时间 [s]|時間[s]|时间戳|時刻",
    "position": "Lageistwert [mm]|Istposition|Ist-Lage|Position mesurée (mm)|angle moteur|"
    "实际位置 [mm]|位置反馈|当前位置|現在位置[mm]|実位置|モータ位置|ﾓｰﾀ位置",
    "velocity": "Drehzahlistwert [U/min]|Istgeschwindigkeit|Motordrehzahl|vitesse réelle|"
    "实际速度 [rad/s]|转速|电机速度|回転速度 [r/min]|モーター速度",
    "force": "Motorstrom [A]|Antriebskraft [N]|Antriebsmoment|Drehmomentistwert|Istmoment|"
    "Kraft [N]|couple mesuré (Nm)|courant|"
    "实际转矩|电机电流（A）|扭矩 [N·m]|トルク [N·m]|モータ電流|推力",
    "reference": "Sollposition|Lagesollwert|consigne de position|位置指令|目标位置|"
    "指令位置|目標位置",
    "temperature": "Motortemperatur|温度",
}  # fmt: skip
# What is wanted, or something else altogether, is no signal of the axis.
NONE = (
    "Sollmoment|Drehzahlsollwert|consigne de vitesse|トルク指令|速度指令|Strom Vorgabe|"
    "Kommentar|状态"
)


@pytest.mark.parametrize(
    ("name", "role"), [(name, role) for role, names in NAMES.items() for name in names.split("|")]
)
def test_a_column_is_known_by_its_name(name, role):
    assert describe(name)[0] == role


@pytest.mark.parametrize("name", NONE.split("|"))
def test_what_is_wanted_is_not_what_is_measured(name):
    assert describe(name)[0] is None


def test_units_stand_in_brackets_of_any_width():
    assert describe("电机电流（A）") == ("force", "A")
    assert describe("Drehzahl [U/min]") == ("velocity", "rpm")
    assert describe("speed [min⁻¹]") == ("velocity", "rpm")
    assert describe("couple mesuré (N·m)") == ("force", "N·m")


def test_english_words_stay_what_they_are():
    for word in ("velocity", "assist", "linear", "x", "s", "de", "torquex"):
        assert english(word) == [word]


def test_a_german_log_is_read(tmp_path):
    path = tmp_path / "achse.csv"
    rows = [f"{i / 1000};{np.sin(i / 50):.5f};{np.cos(i / 50):.5f}" for i in range(400)]
    text = "\n".join(["Zeit [s];Lageistwert [m];Istkraft [N]", *rows]).replace(".", ",")
    path.write_text(text, "utf-8")
    read = jf.read(path)
    assert read.num_samples == 400 and read.unit_names == {"force": "N", "position": "m"}


# ---- without a clock ----


@pytest.fixture
def timeless(tmp_path):
    lines = (tmp_path / "axis.csv", tmp_path / "timeless.csv")
    write_axis(lines[0])
    text = lines[0].read_text("utf-8").splitlines()
    lines[1].write_text("\n".join(row.partition(",")[2] for row in text), "utf-8")
    return str(lines[1])


def test_a_stated_rate_is_a_clock(timeless):
    read, notes = read_with_notes(timeless, rate=1000)
    np.testing.assert_allclose(read.time, np.arange(2001) / 1000)
    assert "counted at the stated 1000 Hz" in notes[0]


def test_without_clock_and_rate_the_message_has_the_remedy(timeless, capsys):
    assert main(["identify", timeless]) == 2
    assert "--rate HZ" in capsys.readouterr().err


def test_a_rate_beside_a_clock_is_refused(tmp_path):
    path = write_axis(tmp_path / "axis.csv")
    with pytest.raises(ValueError, match="without a clock, and 'time' is one"):
        jf.read(path, rate=500)
    assert jf.read(path, rate=500, columns={"time": ""}).time[-1] == pytest.approx(4.0)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_is_over_zero(timeless, rate, capsys):
    with pytest.raises(ValueError, match="rate"):
        jf.read(timeless, rate=rate)
    with pytest.raises(SystemExit):
        main(["identify", timeless, "--rate", str(rate)])
    assert "is not a number" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_identifies_at_a_stated_rate(timeless, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    assert main(["identify", timeless, "--rate", "1000", "--model", "coulomb-viscous"]) == 0
    assert "stated 1000 Hz" in capsys.readouterr().out


# ---- did you mean ----


def test_the_nearest_is_meant():
    assert meant("gausian", jf.models.names()) == " Did you mean gaussian?"
    assert meant("zzz", ["gaussian"]) == ""


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["expain", "axis.csv"], "explain"),
        (["explain", "axis.csv", "--hodlout", "b.csv"], "--holdout"),
        (["export", "m.json", "--to", "modelca"], "modelica"),
    ],
)
def test_the_command_says_what_was_meant(arguments, word, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2 and f"Did you mean {word}?" in capsys.readouterr().err


def test_a_column_that_is_nearly_there_is_named(tmp_path, capsys):
    path = write_axis(tmp_path / "axis.csv")
    assert main(["identify", path, "--columns", "force=forse [N]"]) == 2
    assert "Did you mean force [N]?" in capsys.readouterr().err


@pytest.mark.parametrize("command", EXAMPLES)
def test_every_help_has_examples(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    told = capsys.readouterr().out
    assert "examples:" in told and f"  jaxfric {command}" in told


def test_the_types_are_declared():
    code = "import importlib.resources as r; print((r.files('jaxfric') / 'py.typed').is_file())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"


# ---- completion ----


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_a_shell_completes_commands_options_and_names(shell, capsys):
    pytest.importorskip("shtab")
    with pytest.raises(SystemExit) as stop:
        main(["--print-completion", shell])
    script = capsys.readouterr().out
    assert stop.value.code == 0
    for word in ("identify", "fleet", "holdout", "modelica", "symmetric-gaussian", "cogging"):
        assert word in script


def test_bash_takes_the_script(tmp_path, capsys):
    pytest.importorskip("shtab")
    with pytest.raises(SystemExit):
        main(["--print-completion", "bash"])
    ask = "COMP_WORDS=(jaxfric expl); COMP_CWORD=1; _shtab_jaxfric; echo ${COMPREPLY[@]}"
    script = tmp_path / "script"
    script.write_text(f"{capsys.readouterr().out}\n{ask}\n", "utf-8")
    done = subprocess.run(["bash", str(script)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["explain"]


def test_without_shtab_the_extra_is_named(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    with pytest.raises(SystemExit) as stop:
        main(["--print-completion", "bash"])
    assert stop.value.code == 2 and "jaxfric[completion]" in capsys.readouterr().err


# ---- progress ----


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("there", [True, False])
def test_progress_goes_to_a_terminal_only(there, monkeypatch):
    """With rich and without; nothing from outside steers the terminal."""
    if not there:
        monkeypatch.setitem(sys.modules, "rich.console", None)
    for stream, wanted in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        with working("explaining \x1b[31mevil[bold].csv") as doing:
            doing("fitting the baseline")
        assert ("explaining" in stream.getvalue()) == wanted
        assert "\x1b[31m" not in stream.getvalue()
