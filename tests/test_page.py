"""The page of an explanation: complete, self-contained, safe against what files are called."""

import copy
import json
import re
import types
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation import errors
from jaxfric.identification import tabulate
from jaxfric.report import advice, charts, equations, page

pytest.importorskip("jinja2", reason="pages need jinja2")

FINDINGS = [
    {
        "effect": "cogging",
        "confusable_with": ["gravity_unbalance"],
        "separate_by": "Change the speed.",
        "equation": "Σ A_n sin(2πn x/p + φ_n)",
        "parameters": {
            "amplitude": {"value": 1.2, "standard_error": 0.1, "unit": "N"},
            "pitch": {"value": 0.0109, "standard_error": None, "unit": "m"},
        },
        "share": 0.58,
        "holdout_share": 0.55,
        "p_value": 0.0005,
        "sentence": "A force periodic in position, period 10.9 mm & amplitude 1.2 N ± 0.2 N.",
    },
    {
        "effect": "parameter_mismatch",
        "confusable_with": [],
        "equation": "θ = θ₀ + Δθ",
        "parameters": {"inertia": {"from": 4.2, "to": 4.9, "standard_error": 0.02, "unit": "kg"}},
        "share": 0.2,
        "holdout_share": None,
        "p_value": 0.004,
        "sentence": "Wrong values: inertia is 4.90 kg ± 0.04 kg, not 4.2.",
    },
]
DOCUMENT = {
    "schema": "jaxfric.explanation/1",
    "recording": {
        "file": "axis.csv",
        "samples": 30000,
        "duration": 30.0,
        "sample_rate": 1000.0,
        "sha256": "0123abcd" * 8,
        "notes": ["2 samples with no number left out"],
    },
    "baseline": {
        "name": "gaussian",
        "parameters": {"coulomb+": {"value": 19.98, "standard_error": 0.1, "unit": "N"}},
    },
    "verdict": "explained",
    "where": [
        {"coordinate": "position", "share": 0.61, "p_value": 0.0005, "detail": "period 10.9 mm"}
    ],
    "findings": FINDINGS,
    "fit": {
        "force_error": {"before": 0.084, "after": 0.031},
        "holdout_force_error": {"before": 0.09, "after": 0.035},
        "simulation_error": None,
        "noise_floor": 0.03,
    },
    "not_visible": [{"effect": "load_dependent_friction", "smallest_detectable": 0.8, "unit": "N"}],
    "model": {"units": {"force": "N", "position": "m"}},
    "versions": {"jaxfric": "0.1.0", "jax": "0.10.2"},
}


def curves():
    t, x = np.linspace(0, 30, 1500), np.linspace(-0.1, 0.1, 60)
    v = np.linspace(-0.3, 0.3, 201)
    draw = np.random.default_rng(0)
    force = 20 * np.sign(np.sin(2 * t)) + 3 * np.cos(2 * t)
    ripple = 1.2 * np.sin(2 * np.pi * 0.1 * np.sin(2 * t) / 0.0109)
    noise = 0.3 * draw.standard_normal((4, t.size))
    time = {
        "time": t,
        "measured": force + ripple + noise[0],
        "before": force,
        "after": force + ripple,
    }
    bend = np.sign(v) * (20 + 6 * np.exp(-((v / 0.02) ** 2))) + 60 * v
    found = {
        "findings": [
            {
                "coordinate": "position, folded at 0.0109 m",
                "unit": "m",
                "at": np.linspace(0, 0.0109, 60),
                "measured": ripple[:60],
                "error": np.full(60, 0.1),
                "law": ripple[:60],
                "low": ripple[:60] - 0.2,
                "high": ripple[:60] + 0.2,
                "before": ripple[:60],
                "before_error": np.full(60, 0.1),
                "after": noise[1][:60],
            },
            {
                "coordinate": "acceleration",
                "unit": "m/s²",
                "at": x,
                "measured": x,
                "error": 0 * x,
                "law": x,
                "before": x,
                "after": 0 * x,
            },
        ],
        "map": [
            {
                "coordinate": "position",
                "unit": "m",
                "at": x,
                "before": 1.2 * np.sin(2 * np.pi * x / 0.0109),
                "after": 0.05 * draw.standard_normal(x.size),
                "error": np.full(x.size, 0.1),
            },
            {
                "coordinate": "time_since_reversal",
                "unit": "s",
                "at": x + 0.1,
                "before": 0.1 * draw.standard_normal(x.size),
                "after": None,
            },
            {
                "coordinate": "velocity",
                "unit": "m/s",
                "at": x,
                "before": x,
                "after": 0 * x,
                "error": None,
            },
        ],
        "time": time,
        "holdout": time,
        "friction": {"velocity": v, "before": bend - 0.5, "after": bend},
        "units": {"force": "N", "position": "m"},
    }
    return plain(found)


def plain(value):
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


class Reader(HTMLParser):
    """Text, headings and what is loaded from elsewhere; complains of tags that do not close."""

    def __init__(self, text):
        super().__init__()
        self.open, self.links, self.text, self.headings = [], [], [], []
        self.feed(text)
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.links += [value for name, value in attrs if name in ("src", "href", "srcset")]
        if tag not in ("meta", "br", "link", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.text.append(data)
            if self.open and self.open[-1] in ("h1", "h2"):
                self.headings.append(data)


def words(text):
    return " ".join(" ".join(Reader(text).text).split())


@pytest.fixture(scope="module")
def full():
    return page.render(
        DOCUMENT | {"model": model().to_dict()}, curves(), "jaxfric explain", "today"
    )


def model():
    terms = jf.terms
    structure = terms.Inertia() + terms.Directional(terms.Coulomb()) + terms.Cogging(harmonics=1)
    values = {"inertia": 4.2, "coulomb+": 20.0, "coulomb-": 18.0, "pitch": 0.0109}
    values |= {"cogging_sin": 1.2, "cogging_cos": -0.3}
    return jf.models.from_parameters(structure, values)


def drawn(text):
    """What the pictures are drawn from."""
    found = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    return [json.loads(each) for each in found]


def test_every_part_is_there(full):
    seen = Reader(full)
    assert seen.headings == [
        "axis.csv · baseline gaussian",
        "Findings",
        "Where the baseline errs",
        "Force over time",
        "Held-out recording",
        "The improved model",
        "What this recording could not have shown",
        "How to reproduce",
    ]
    said = words(full)
    for finding in FINDINGS:
        assert finding["sentence"] in said
    for piece in (
        "Explained.", "8.40% → 3.10%", "9.00% → 3.50%", "58%", "p < 0.001", "gravity unbalance",
        "change the speed.", "4.2 → 4.9", "not visible", "load dependent friction", "0.8",
        "30000", "1000 Hz", "2 samples with no number left out", "period 10.9 mm", "0123abcd",
        "jaxfric 0.1.0", "jaxfric explain", "1.2 · sin(2π x / 0.0109)", "− 0.3 · cos(",
        "double axis_force(", 'frictionloss="', "What to do next",
    ):  # fmt: skip
        assert piece in said, piece
    titles = [chart["title"] for chart in drawn(full)]
    assert len(titles) == len(set(titles)) + 1  # what is left, here and held out
    assert len(full.encode()) < 500_000


def test_a_page_is_small_with_the_longest_record():
    """3000 points are drawn of any record."""
    time = np.linspace(0, 30, 3000)
    noisy = np.random.default_rng(1).standard_normal(3000)
    series = plain({"time": time, "measured": noisy, "before": noisy / 3, "after": noisy / 7})
    text = page.render(DOCUMENT, curves() | {"time": series, "holdout": series})
    assert len(text.encode()) < 600_000


def test_pictures_are_over_the_coordinate_that_was_fitted(full):
    hero, card = drawn(full)[:2]
    assert "folded at 0.0109 m" in hero["title"] and "folded at 0.0109 m" in card["title"]
    assert hero["x"]["unit"] == "mm" and hero["y"]["unit"] == "N"
    before, after = (
        next(s for s in hero["series"] if s["key"] == key) for key in ("before", "after")
    )
    assert before["bars"] and not after["bars"]
    assert [each["kind"] for each in card["series"]] == ["band", "points", "line"]
    assert all(len(column) == len(card["data"][0]) for column in card["data"])


def test_gaps_stay_gaps():
    chart = charts.in_time(
        {"time": [0, 1, 2], "measured": [1.0, None, 2.0], "before": [1.0, None, 1.0]}, "N"
    )
    assert [picture["data"][1] for picture in chart] == [[1.0, None, 2.0], [0.0, None, 1.0]]


def test_friction_is_not_drawn_where_nothing_was_seen():
    one = curves() | {"friction": {"velocity": [0.1, 0.2], "before": [1.0, 2.0], "after": [1, 2]}}
    text = page.render(DOCUMENT, one)
    assert "the other direction was not seen" in words(text)
    chart = next(each for each in drawn(text) if each["title"] == "Friction over velocity")
    assert chart["data"][0] == [0, 0.1, 0.2] and chart["data"][1][0] is None


def test_mean_forces_at_constant_velocity_stand_beside_the_friction_curve():
    held = [{"velocity": 0.15, "force": 1.6, "half": 0.2}]
    friction = {"velocity": [0.1, 0.2], "before": [1.0, 2.0], "after": [1, 2], "held": held}
    text = page.render(DOCUMENT, curves() | {"friction": friction})
    chart = next(each for each in drawn(text) if each["title"] == "Friction over velocity")
    assert chart["data"][0] == [0, 0.1, 0.15, 0.2]
    assert chart["series"][-1]["label"].startswith("mean at constant velocity")
    assert [column[2] for column in chart["data"][-3:]] == pytest.approx([1.6, 1.4, 1.8])


def test_an_unseen_parameter_is_no_number():
    rows = equations.rows(model().with_parameters({"coulomb-": float("nan")}))
    coulomb = next(row for row in rows if row.name == "coulomb")
    assert coulomb.products == ("20 · sign v, v > 0", "+ ? · sign v, v < 0")


def test_a_page_says_what_f_is_where_a_formula_reads_it_and_shows_what_was_not_seen(full):
    ripple = jf.models.from_parameters(
        model().term + jf.terms.ForceRipple(), model().parameters | {
            "coulomb-": float("nan"), "ripple_sin": 0.1, "ripple_cos": 0.0, "pitch_2": 0.02,
        },
    )  # fmt: skip
    seen = page.render(DOCUMENT | {"model": ripple.to_dict()}, curves(), "jaxfric explain", "today")
    assert "f the sum without the terms that hold it" in seen and "stands for what" in seen
    screw = jf.models.from_parameters(
        model().term + jf.terms.ReactionFriction(), model().parameters | {"reaction_friction": 0.1}
    )
    seen = page.render(DOCUMENT | {"model": screw.to_dict()}, curves(), "jaxfric explain", "today")
    assert "r what of the sum is no friction" in seen
    assert "f the sum without" not in full and "stands for what" not in full


def test_a_term_with_a_memory_is_given_by_its_law():
    lugre = jf.terms.Dahl()
    names = [p.name for p in (*lugre.affine, *lugre.nonlinear)]
    (row,) = equations.rows(jf.models.from_parameters(lugre, dict.fromkeys(names, 2.0)))
    assert row.law and "presliding_force = 2" in row.values


@pytest.mark.parametrize("verdict", ["consistent", "explained", "partly_explained", "unexplained"])
def test_every_verdict_is_one_sentence_and_says_what_to_do(verdict):
    document = DOCUMENT | {"verdict": verdict}
    assert len(re.findall(r"[a-z0-9%]\. [A-Z]", advice.headline(document))) == 0
    assert advice.steps(document)
    text = page.render(document)
    assert advice.headline(document) in words(text)
    assert all(step in words(text) for step in advice.steps(document))


def test_what_is_severe_comes_first():
    remark = {"name": "sign", "text": "The force has the wrong sign.", "severe": True}
    document = DOCUMENT | {"warnings": [remark], "findings": [], "verdict": "unexplained"}
    text = words(page.render(document))
    assert text.index("wrong sign") < text.index("What to do next")
    assert "Put right" in text and text.count("The force has the wrong sign.") == 1


def test_nothing_is_loaded_from_elsewhere(full):
    assert Reader(full).links == []
    outside = re.sub(r"<script>.*?</script>", "", full, flags=re.DOTALL)
    assert "@import" not in outside and "url(" not in outside


def test_without_curves_there_is_no_picture_and_no_script():
    text = page.render(DOCUMENT, {})
    assert "<script" not in text and len(text) < 20000
    assert "Friction over velocity" not in text and FINDINGS[1]["sentence"] in words(text)


@pytest.mark.parametrize(
    "absent", ["findings", "where", "fit", "not_visible", "baseline", "model", "recording"]
)
@pytest.mark.parametrize("empty", [True, False])
def test_a_missing_part_is_left_out(absent, empty):
    document = copy.deepcopy(DOCUMENT)
    if empty:
        document[absent] = type(document[absent])()
    else:
        del document[absent]
    assert "Explained." in words(page.render(document))


@pytest.mark.parametrize("absent", ["findings", "map", "time", "holdout", "friction", "units"])
def test_a_missing_picture_is_left_out(absent):
    text = page.render(DOCUMENT, curves() | {absent: None})
    fewer = {"findings": 2, "map": 2, "time": 2, "holdout": 1, "friction": 1, "units": 0}
    assert text.count('class="chart"') == 9 - fewer[absent]


def test_names_are_text_and_not_html():
    evil = "<script>alert(1)</script>&.csv"
    document = copy.deepcopy(DOCUMENT)
    document["recording"]["file"] = evil
    document["findings"][0]["sentence"] = f"x {evil}"
    document["baseline"]["name"] = evil
    document["model"]["units"] = {"force": evil, "position": evil}
    pictures = curves() | {"units": {"force": evil, "position": evil}}
    pictures["map"][0]["coordinate"] = evil
    pictures["findings"][0]["coordinate"] = evil
    text = page.render(document, pictures)
    assert "<script>alert" not in text
    assert evil in unescape(words(text))


def test_another_document_is_refused():
    with pytest.raises(ValueError, match="Not an explanation"):
        page.render({"schema": "jaxfric.identification/1"})


def test_where_nothing_was_found_there_is_no_improved_model_to_draw():
    text = page.render(DOCUMENT | {"findings": [], "verdict": "consistent"}, curves())
    labels = {series["label"] for chart in drawn(text) for series in chart["series"]}
    assert "baseline" in labels and not any("improved" in label for label in labels)


def test_two_recordings_are_compared_in_words_of_change():
    base = {"name": "recording old.csv", "parameters": {}}
    document = DOCUMENT | {"baseline": base, "findings": [], "verdict": "consistent"}
    assert "Nothing differs between the two recordings" in advice.headline(document)
    assert "compare the next one" in advice.steps(document)[0]
    moved = FINDINGS[1] | {"sentence": "Coulomb friction rose from 2 to 3 N (± 0.1) since a; 9% x."}
    document = document | {"findings": [moved], "verdict": "explained"}
    assert advice.headline(document).startswith("Coulomb friction rose from 2 to 3 N (± 0.1) since")


SLOWEST = {"slowest": {"value": 3.9205, "unit": "mm/s"}}
SLOWER = "slower than 3.92 mm/s: of friction below that"


@pytest.mark.parametrize("known", [True, False])
def test_below_which_speed_nothing_is_said_stands_on_the_page_and_in_the_text(known):
    """Of a bump slower than every row "stribeck would have been seen from 0.034 N" was said."""
    fit = DOCUMENT["fit"] | {"filtered_force_error": SLOWEST if known else {"slowest": None}}
    document = DOCUMENT | {"fit": fit}
    assert (SLOWER in page.render(document, {})) == known
    (*_, last) = tabulate._places(document)
    assert (SLOWER in last[0] if isinstance(last, list) else False) == known


@pytest.mark.parametrize(
    ("speeds", "reversals", "curve", "slowest"),
    [
        ([-3.0, 0.5, 2.0], False, {}, 0.5),
        ([-3.0, 0.15, 2.0], False, {}, None),
        ([-3.0, 0.5, 2.0], True, {}, None),
        ([-3.0, 0.5, 2.0], False, {"stribeck_force+": None}, None),
    ],
)
def test_nothing_is_said_below_the_speed_of_the_slowest_row(speeds, reversals, curve, slowest):
    evidence = types.SimpleNamespace(
        motion=types.SimpleNamespace(
            velocity=np.array([0.01, *speeds]), unit_names={"position": "mm", "force": "N"}
        ),
        centre=np.arange(1, 4),
        limits=types.SimpleNamespace(slowest=0.1),
    )
    found = types.SimpleNamespace(
        problem=types.SimpleNamespace(evidence=evidence, reversals=reversals),
        selection=types.SimpleNamespace(curve=curve),
    )
    expected = None if slowest is None else {"value": slowest, "unit": "mm/s"}
    assert errors._slowest(found) == expected
