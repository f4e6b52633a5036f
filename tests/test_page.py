"""The page of an explanation: complete, self-contained, safe against what files are called."""

import copy
import re
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

from jaxfric.report import page

pytest.importorskip("plotly", reason="pages need plotly")

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
    return page.render(DOCUMENT, curves())


def test_every_part_is_there(full):
    seen = Reader(full)
    assert seen.headings == [
        "What the model leaves out",
        "Findings",
        "How to tell confusable effects apart",
        "Where the model and the recording differ",
        "Before and after in time",
        "Held-out recording",
        "Friction curve",
        "Parameters",
        "What this recording could not have shown",
        "Recording",
    ]
    said = words(full)
    for finding in FINDINGS:
        assert finding["sentence"] in said
    for piece in (
        "Explained.", "8.40% → 3.10%", "9.00% → 3.50%", "58%", "< 0.001", "gravity unbalance",
        "Change the speed.", "4.2 → 4.9", "not visible", "load dependent friction", "0.8",
        "30000", "1000 Hz", "2 samples with no number left out", "period 10.9 mm",
    ):  # fmt: skip
        assert piece in said, piece
    assert full.count('class="plotly-graph-div"') == 4


def test_nothing_is_loaded_from_elsewhere(full):
    assert Reader(full).links == []
    outside = re.sub(r"<script>.*?</script>", "", full, flags=re.DOTALL)
    assert "@import" not in outside and "url(" not in outside


def test_no_button_uploads_the_recording(full):
    """Plotly's bar of buttons can have one."""
    assert full.count('"modeBarButtonsToRemove": ["sendChartToCloud"') == 4
    assert "BASE_URL='" not in full and "window.PLOTLYENV.BASE_URL=" not in full.split("<body>")[1]


def test_without_curves_there_is_no_picture_and_no_script():
    text = page.render(DOCUMENT, {})
    assert "<script" not in text and len(text) < 20000
    assert "Friction curve" not in text and FINDINGS[1]["sentence"] in words(text)


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


@pytest.mark.parametrize("absent", ["map", "time", "holdout", "friction", "units"])
def test_a_missing_picture_is_left_out(absent):
    text = page.render(DOCUMENT, curves() | {absent: None})
    expected = 4 - (absent != "units")
    assert text.count('class="plotly-graph-div"') == expected


@pytest.mark.parametrize("verdict", ["consistent", "explained", "partly_explained", "unexplained"])
def test_every_verdict_has_its_colour_and_sentence(verdict):
    document = DOCUMENT | {"verdict": verdict}
    text = page.render(document)
    name, tone, sentence = page._VERDICTS[verdict]
    assert f"--tone: {tone}" in text and f"{name}. {sentence}" in words(text)
    assert "The summary." in words(page.render(document | {"summary": "The summary."}))


def test_names_are_text_and_not_html():
    evil = "<script>alert(1)</script>&.csv"
    document = copy.deepcopy(DOCUMENT)
    document["recording"]["file"] = evil
    document["findings"][0]["sentence"] = f"x {evil}"
    document["baseline"]["name"] = evil
    document["model"]["units"] = {"force": evil, "position": evil}
    pictures = curves() | {"units": {"force": evil, "position": evil}}
    pictures["map"][0]["coordinate"] = evil
    text = page.render(document, pictures)
    assert "<script>alert" not in text
    assert evil in unescape(words(text))


def test_another_document_is_refused():
    with pytest.raises(ValueError, match="Not an explanation"):
        page.render({"schema": "jaxfric.identification/1"})
