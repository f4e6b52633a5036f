"""How results print, look in notebooks and are drawn; and that this never raises."""

import dataclasses
import json
import re
import sys
from html.parser import HTMLParser

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies

import jaxfric as jf
from jaxfric.explanation.finding import Finding
from jaxfric.identification import tabulate
from jaxfric.identification.documents import to_json
from jaxfric.identification.identified import result_names
from jaxfric.looks import drawing, html, text
from jaxfric.looks.text import Table

EVIL = "<script>alert('$x$')</script>.csv"


@pytest.fixture(scope="module")
def recording():
    axis = jf.scenario.machine()
    return jf.scenario.record(
        axis, force_noise=0.5, key=jax.random.key(0), sample_rate=1000.0, periods=2
    )


@pytest.fixture(scope="module")
def fit(recording):
    return jf.identify("lorentzian", recording)


@pytest.fixture(scope="module")
def batch(fit):
    """Four rows, the last one without result."""

    def rows(leaf):
        return jnp.stack([leaf] * 4)

    many = jax.tree.map(rows, fit)
    failed = result_names().index("no_slip")
    many = eqx.tree_at(lambda f: f.result._value, many, many.result._value.at[3].set(failed))
    return eqx.tree_at(
        lambda f: (f.filtered_force_error, f.model.alpha),
        many,
        replace_fn=lambda x: x.at[3].set(jnp.nan),
    )


@pytest.fixture(scope="module")
def explanation(fit):
    """An explanation as `explain` returns it, with numbers made up."""
    sentence = f"A force periodic in position, amplitude 1.2 N ± 0.2 N; {EVIL}."
    amplitude = jf.Estimate(1.2, 0.1, "N")
    finding = Finding(
        "cogging", "A sin(2πx/λ + φ)", sentence, ("spring",), "Move farther.",
        {"amplitude": amplitude}, 0.58, 0.55, 0.001,
    )  # fmt: skip
    at = np.linspace(0, 1, 50)
    before, after = np.sin(6 * at).tolist(), (0.1 * at).tolist()
    series = {"time": at.tolist(), "measured": before, "before": after, "after": before}
    place = {"unit": "m", "at": at.tolist(), "before": before, "after": after, "error": after}
    curves = {
        "units": {"force": "N", "position": "m"},
        "map": [{"coordinate": name, **place} for name in ("position", "time_since_reversal")],
        "time": series,
        "holdout": series,
        "friction": {"velocity": (at - 0.5).tolist(), "before": after, "after": before},
    }
    return jf.Explanation(
        verdict="explained",
        where=[{"coordinate": "position", "share": 0.6, "p_value": 0.001, "detail": "10 mm"}],
        findings=[finding],
        fit={
            "force_error": {"before": 0.08, "after": 0.03},
            "holdout_force_error": {"before": 0.09, "after": 0.04},
            "noise_floor": 0.02,
        },
        not_visible=[{"effect": "backlash", "smallest_detectable": 0.8, "unit": "N"}],
        model=fit.model,
        baseline=fit.model,
        baseline_name="lorentzian",
        baseline_parameters={"coulomb+": amplitude},
        recording={"file": EVIL, "samples": 100, "duration": 1.0},
        curves=curves,
    )


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.fixture
def no_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)


class Reader(HTMLParser):
    """The text and the tags of a piece of HTML, each of which must be closed."""

    def __init__(self, source):
        super().__init__()
        self.open, self.tags, self.said = [], set(), ""
        self.feed(source)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] != ["style"]:
            self.said += data


def is_tree(printed):
    return printed.startswith(("Identified(", "Recording(", "Model("))


def test_a_fit_prints_model_parameters_and_how_it_ended(fit):
    printed = str(fit)
    assert printed == repr(fit)
    assert "model lorentzian; closed windows (1 window, " in printed
    assert re.search(r"coulomb\+ +\d+\.\d+ +\d\.\d+ +N\n", printed)
    assert re.search(r"viscous- +\d+\.\d+ +\d\.?\d* +N·s/m\n", printed)
    assert (
        f"filtered force error {float(fit.filtered_force_error):.2%}   result successful" in printed
    )
    assert max(map(len, printed.splitlines())) <= text.WIDTH


@pytest.mark.parametrize("error, told", [(0.01, False), (0.17, True), (None, False)])
def test_a_filter_that_reaches_over_rest_is_said(error, told):
    document = {
        "force_error": 0.02, "filtered_force_error": error, "filter_half_width": 0.12,
    }  # fmt: skip
    printed = tabulate._errors(document)
    assert printed.startswith("force error 2.00%; filtered force error")
    assert ("(240 ms, which reach over reversals and rest)" in printed) == told


def test_the_interval_printed_is_that_of_the_estimate(fit):
    low, high = fit.parameters["coulomb+"].interval()
    half = f"{0.5 * float(high - low):.2g}"
    row = next(line for line in str(fit).splitlines() if line.startswith("coulomb+"))
    assert row.split()[2] == half


@pytest.mark.parametrize("variance", [np.inf, np.nan])
def test_what_is_not_visible_is_said(fit, variance):
    blind = eqx.tree_at(lambda f: f.covariance, fit, fit.covariance.at[1, 1].set(variance))
    assert re.search(r"coulomb\+ +- +not visible +N\n", str(blind))
    data = json.dumps(blind.to_dict(), allow_nan=False)
    assert json.loads(data)["parameters"]["coulomb+"]["standard_error"] is None
    unknown = eqx.tree_at(lambda f: f.filtered_force_error, fit, jnp.nan)
    assert "force error unknown" in str(unknown)


def test_the_diagnosis_and_the_warnings_are_printed(fit):
    failed = jnp.asarray(result_names().index("no_slip"), jnp.int32)
    bad = eqx.tree_at(lambda f: f.result._value, fit, failed)
    place = jf.identification.identified.checks.NAMES.index("large_error")
    bad = eqx.tree_at(lambda f: f.warnings, bad, np.full(np.shape(fit.warnings), np.nan))
    bad.warnings[place] = 0.4
    printed = " ".join(str(bad).split())
    assert "result no_slip The axis never slips" in printed
    assert "Warning: The model leaves 40% of the force" in printed


def test_a_recording_prints_its_signals(recording):
    printed = str(recording)
    assert printed.startswith("scenario: 4001 samples, 4 s at 1000 Hz\n")
    for name, unit in (("position", "m"), ("velocity", "m/s"), ("reference_velocity", "m/s")):
        assert re.search(rf"^{name}( +-?[\d.]+){{3}}  {unit}$", printed, re.MULTILINE)
    least, greatest = np.min(recording.force), np.max(recording.force)
    assert re.search(rf"^force +{least:.4g} +{greatest:.4g} ", printed, re.MULTILINE)


def test_a_recording_prints_what_is_left_out(recording):
    part = (np.arange(4001) > 2000).astype(int)
    cut = dataclasses.replace(
        recording,
        source=EVIL,
        velocity=None,
        mask=np.arange(4001) > 10,
        segment=part,
        num_segments=2,
        force=recording.force.at[50].set(jnp.nan),
        units={"force": "A", "position": "deg"},
    )
    printed = str(cut)
    assert f"{EVIL}: 4001 samples (11 left out)" in printed and "2 segments" in printed
    assert "A  (1 not finite)" in printed and " deg\n" in printed
    assert "velocity is not recorded: it is derived from the position" in printed
    nothing = dataclasses.replace(cut, mask=np.zeros(4001, bool))
    assert re.search(r"force +- +- +- +A", str(nothing))


def test_a_batch_of_recordings(recording):
    printed = str(jf.stack([recording, jf.pad(recording, 5000)]))
    assert printed.startswith("2 recordings of 5000 samples each, 4001 of them valid")


def test_a_model_prints_its_parameters(fit):
    printed = str(jf.scenario.machine())
    assert printed.startswith("model lorentzian\n")
    assert re.search(r"coulomb\+ +=  +20  N\n", printed)
    own = jf.terms.Inertia() + jf.terms.Directional(jf.terms.Coulomb() + jf.terms.Spring())
    model = jf.Model(own, np.arange(5.0))
    assert str(model).startswith("model Inertia + Directional(Coulomb + Spring)\n")
    assert re.search(r"inertia +=  +0  kg", Reader(model._repr_html_()).said) is None
    assert "inertia" in Reader(model._repr_html_()).said
    assert [jf.models.name_of(jf.models.named(name)) for name in jf.models.names()] == list(
        jf.models.names()
    )


def test_an_explanation_prints_its_sentences(explanation):
    printed = " ".join(str(explanation).split())
    for piece in (
        "explained: The named physics accounts",
        "Force error 8.00% before, 3.00% after; on the held-out recording 9.00% before, 4.00%",
        "cogging A force periodic in position, amplitude 1.2 N ± 0.2 N",
        "To tell: Move farther.",
        "position 60% 0.001 10 mm",
        "backlash 0.8 N",
    ):
        assert piece in printed, piece
    assert repr(dataclasses.replace(explanation, fit={})) == "Explanation(verdict='explained')"


def test_a_batch_says_how_many_and_medians(batch, fit):
    printed = str(batch)
    assert "4 recordings: 3 successful, 1 no_slip\n" in printed
    assert "not successful: row 3." in printed
    median = f"{float(fit.parameters['coulomb+'].value):.5g}"
    assert re.search(rf"coulomb\+( +{median}){{3}} +[\d.]+  N\n", printed)
    assert f"{float(fit.filtered_force_error):.2%}" in printed
    assert "medians of 4 rows" in str(batch.model)
    lost = eqx.tree_at(lambda f: f.result._value, batch, jnp.full(4, 1, jnp.int32))
    assert "None is successful" in str(lost)
    assert "4 recordings" in Reader(batch._repr_html_()).said
    with pytest.raises(ValueError, match="take a row"):
        batch.plot()
    with pytest.raises(ValueError, match="take a row"):
        batch.to_dict()


def test_a_row_of_a_batch_prints_as_the_fit(batch, fit):
    assert str(batch[0]) == str(jax.tree.map(lambda x: x[0], batch)) == str(fit)


def test_rows_of_a_batch_by_number(batch, fit):
    assert len(batch) == len(list(batch)) == 4
    assert [row.result_name for row in batch] == ["successful"] * 3 + ["no_slip"]
    assert batch[-1].result_name == "no_slip"
    assert batch[0].remarks == fit.remarks
    assert len(batch[1:]) == 3
    assert len(batch[np.array([0, 3])]) == 2
    with pytest.raises(IndexError, match="no row 4: the batch has 4"):
        batch[4]
    with pytest.raises(TypeError, match="one identification, not a batch"):
        fit[0]
    assert fit


@pytest.mark.parametrize("name", ["result_name", "remarks", "diagnosis"])
def test_what_is_of_one_row_names_the_remedy(batch, name):
    with pytest.raises(ValueError, match=rf"no {name} of its own. Of a batch .* fits\[0\]"):
        getattr(batch, name)


def test_the_report_is_what_needs_the_recording_too(fit, recording, batch):
    said = fit.report(recording)
    table = str(fit).split("\n\n")[1]
    assert table in said and "Constant-velocity test" in said and "Break-away" in said
    with pytest.raises(ValueError, match="no report"):
        batch.report(recording)


def test_a_batch_of_models_names_the_remedy(batch):
    with pytest.raises(ValueError, match=r"not a batch: give a row, fits\[i\].model"):
        batch.model.friction(0.1)
    with pytest.raises(ValueError, match="not a batch"):
        batch.model.to_dict()
    assert jax.vmap(lambda model: model.friction(0.1))(batch.model).shape == (4,)


def test_traced_and_without_values_the_structure_is_printed(fit, batch, recording):
    seen = []

    def look(*trees):
        seen.extend([repr(tree) for tree in trees] + [tree._repr_html_() for tree in trees])
        return trees[0].filtered_force_error

    jax.jit(look)(fit, recording, fit.model)
    jax.vmap(look, in_axes=(0, None))(batch, recording)
    jax.grad(lambda f: look(f, f.model))(eqx.filter(fit, eqx.is_inexact_array))
    shapes = eqx.filter_eval_shape(lambda f: f, fit)
    seen += [repr(shapes), repr(eqx.filter_eval_shape(lambda r: r, recording))]
    assert is_tree(repr(shapes)) and repr(shapes).startswith("Identified(")
    assert sum(printed.startswith(("Identified(", "<pre>Identified(")) for printed in seen) >= 5


def test_a_fit_that_a_traced_function_closes_over_prints_its_values(fit):
    seen = []
    jax.jit(lambda x: (seen.append(str(fit)), x)[1])(1.0)
    assert seen == [str(fit)]


@given(strategies.sampled_from([None, 1.0, np.nan, "text", object(), [], np.zeros((2, 3))]))
def test_whatever_the_leaves_are_it_never_raises(fit, recording, leaf):
    for tree in (fit, recording, fit.model):
        odd = jax.tree.map(lambda _: leaf, tree)
        assert isinstance(repr(odd), str) and isinstance(odd._repr_html_(), str)


def test_printing_compiles_nothing(fit, batch, recording, caplog):
    jax.clear_caches()
    with jax.log_compiles():
        printed = [str(each) for each in (fit, batch, recording, fit.model, batch.model)]
        fit.to_dict()
    assert not any(map(is_tree, printed))
    assert not [record for record in caplog.records if "ompil" in record.getMessage()]


def test_the_pytrees_stay_what_they_were(fit, recording):
    for tree in (fit, recording):
        str(tree), tree._repr_html_()
        leaves, structure = jax.tree.flatten(tree)
        again = jax.tree.unflatten(structure, leaves)
        assert all(isinstance(leaf, jax.Array | np.ndarray) for leaf in leaves)
        assert jax.tree.structure(again) == structure and str(again) == str(tree)
    assert {f.name for f in dataclasses.fields(fit)} == {
        "model", "covariance", "result", "windows", "covered", "filtered_force_error", "cost",
        "open_ends", "weak", "rival", "warnings", "border",
    }  # fmt: skip


def test_html_has_the_same_and_a_picture(fit, recording, explanation):
    pytest.importorskip("matplotlib")
    for each, word in ((fit, "coulomb+"), (recording, "velocity"), (explanation, "cogging")):
        page = Reader(each._repr_html_())
        assert word in page.said and {"table", "img"} <= page.tags


@pytest.mark.slow
def test_where_nothing_was_visible_there_is_no_curve(fit, recording, pyplot):
    blind = eqx.tree_at(lambda f: f.covariance, fit, fit.covariance + jnp.inf)
    assert "img" not in Reader(blind._repr_html_()).tags
    still = dataclasses.replace(recording, velocity=0 * recording.velocity)
    assert not fit.plot(still).get_legend()


def test_html_without_matplotlib_has_no_picture(fit, recording, explanation, no_matplotlib):
    for each in (fit, recording, explanation):
        page = Reader(each._repr_html_())
        assert "table" in page.tags and "img" not in page.tags


def test_what_files_say_is_text_and_not_html(recording, explanation):
    named = dataclasses.replace(
        recording, source=EVIL, units={"force": EVIL, "position": "m"}, channels={}
    )
    named = dataclasses.replace(named, channels={EVIL: named.force})
    for each in (named, explanation):
        page = Reader(each._repr_html_())
        assert "script" not in page.tags and EVIL in page.said
    shape = eqx.filter_eval_shape(lambda r: r, named)
    assert "script" not in Reader(shape._repr_html_()).tags
    evil = html.html([[EVIL, f"  {EVIL}"], Table([[EVIL], [EVIL]])])
    assert Reader(evil).tags == {"div", "style", "p", "table", "thead", "tbody", "tr", "th", "td"}


def test_without_matplotlib_plots_name_the_extra(fit, recording, explanation, no_matplotlib):
    for each in (fit, recording, explanation):
        with pytest.raises(ValueError, match=r"jaxfric\[report\]"):
            each.plot()


def words(axes):
    return {axes.get_xlabel(), axes.get_ylabel(), axes.get_title(), axes.get_title(loc="left")}


def test_a_fit_is_drawn_with_and_without_its_recording(fit, recording, pyplot):
    alone = fit.plot()
    assert {"velocity [m/s]", "friction force [N]"} <= words(alone)
    given = pyplot.figure().subplots()
    assert fit.plot(recording, ax=given) is given
    assert "Friction of scenario" in words(given)
    said = [each.get_text() for each in given.get_legend().get_texts()]
    assert len(said) == 6 and sum("constant velocity" in each for each in said) == 2
    # At the fastest recorded speed the curve ends.
    assert max(given.lines[-3].get_xdata()) <= 1.01 * float(np.max(np.abs(recording.velocity)))


def test_a_recording_is_drawn_signal_by_signal(recording, pyplot):
    panels = recording.plot()
    assert [axes.get_ylabel() for axes in panels] == ["position [m]", "velocity [m/s]", "force [N]"]
    assert panels[-1].get_xlabel() == "time [s]"
    given = pyplot.figure().subplots()
    assert recording.plot(ax=given) is given and given.get_ylabel() == "force [N]"
    assert recording.plot("reference").get_ylabel() == "reference [m]"
    with pytest.raises(ValueError, match="No signal torque; there are position"):
        recording.plot("torque")
    with pytest.raises(ValueError, match="2 pictures, but ax= holds 1"):
        recording.plot("force", "position", ax=given)
    with pytest.raises(ValueError, match="take a row"):
        jf.stack([recording]).plot()


def test_gaps_and_clocks_that_start_again_are_drawn_so(recording, pyplot):
    half = (np.arange(4001) > 2000).astype(int)
    time = np.where(half, recording.time - 2.0, recording.time)
    cut = dataclasses.replace(
        recording, time=time, segment=half, num_segments=2, mask=np.arange(4001) % 100 > 0
    )
    axes = dataclasses.replace(cut, source=EVIL).plot("force")
    assert axes.get_xlabel() == "time, one segment after the other [s]"
    assert np.isnan(axes.lines[0].get_ydata()).any()
    assert np.all(np.diff(axes.lines[0].get_xdata()) > 0)
    axes.figure.canvas.draw()  # the dollars of a file's name are no formula


def test_a_long_signal_is_thinned_to_its_extremes():
    time = np.arange(100_003.0)
    values = np.sin(time)
    values[777], values[5000:9000] = 50.0, np.nan
    at, fewer = drawing.thinned(time, values)
    assert at.size == fewer.size <= 2 * drawing.COLUMNS and np.all(np.diff(at) > 0)
    assert np.nanmax(fewer) == 50.0 and np.isnan(fewer).sum() >= 0.9 * 4000 * at.size / time.size


def test_an_explanation_is_drawn(explanation, pyplot):
    assert len(explanation.plot()) == 6
    assert explanation.plot("where").get_xlabel() == "position [m]"
    assert explanation.plot("where 2").get_xlabel() == "time since reversal [m]"
    given = pyplot.figure().subplots()
    assert explanation.plot(ax=given) is given
    assert "friction force [N]" in words(explanation.plot("friction"))
    with pytest.raises(ValueError, match="No picture 'x'; there are where, where 2, force"):
        explanation.plot("x")
    assert len(dataclasses.replace(explanation, curves={}).plot()) == 0


def test_to_dict_is_the_document_of_the_command(fit, recording):
    document = fit.to_dict(recording)
    assert json.loads(to_json(document)) == json.loads(json.dumps(document, allow_nan=False))
    assert document["schema"] == "jaxfric.identification/1" and document["name"] == "lorentzian"
    assert document["recording"]["samples"] == 4001 and fit.to_dict()["recording"] == {}
    assert document["parameters"]["coulomb+"]["unit"] == "N"
    assert jf.Model.from_dict(document["model"]).parameters.keys() == fit.parameters.keys()


def test_without_pandas_it_is_named(fit, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ValueError, match="pip install pandas"):
        fit.to_pandas()


class Frame:
    """Stands for pandas where it is not installed: keeps what it is given."""

    def DataFrame(self, columns):  # noqa: N802
        assert len({len(column) for column in columns.values()}) == 1
        return columns


def test_to_pandas_has_a_row_for_each_parameter(fit, batch, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", Frame())
    table = fit.to_pandas()
    assert list(table) == ["parameter", "value", "standard_error", "low", "high", "unit"]
    place = table["parameter"].index("viscous-")
    estimate = fit.parameters["viscous-"]
    low, high = estimate.interval()
    found = [table[name][place] for name in ("value", "standard_error", "low", "high", "unit")]
    assert found == [*map(float, (estimate.value, estimate.standard_error, low, high)), "N·s/m"]
    many = batch.to_pandas()
    assert list(many) == ["row", *table, "result"]
    assert many["value"][: len(table["value"])] == table["value"]
    assert many["row"][-1] == 3 and many["result"][-1] == "no_slip"


def test_to_pandas_is_a_data_frame(fit):
    pandas = pytest.importorskip("pandas")
    assert isinstance(fit.to_pandas(), pandas.DataFrame)
