"""The page in headless Chromium: drawn, quick, no complaint, nothing clipped, zoom, print, dark."""

import shutil
import time

import pytest

from jaxfric.report import page

from .test_page import DOCUMENT, curves, model

sync_api = pytest.importorskip("playwright.sync_api", reason="drives the browser")
pytest.importorskip("jinja2", reason="pages need jinja2")
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine"),
    pytest.mark.filterwarnings("ignore"),  # the browser's own
]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "page.html"
    long = {
        "value": -0.0011761,
        "standard_error": 0.00062,
        "interval": [-0.0024, 0.00005],
        "unit": "counts·s²/(N·m)²",
    }
    own = {"name": "gaussian", "parameters": {"stribeck_velocity+": long}}
    document = DOCUMENT | {"model": model().to_dict(), "baseline": own}
    out.write_text(page.render(document, curves(), "jaxfric explain axis.csv", "today"), "utf-8")
    return out


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


def opened(browser, path, width=1280, scheme="light"):
    tab = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    tab.said, tab.asked = [], []
    tab.on("console", lambda message: tab.said.append(message.text))
    tab.on("pageerror", lambda error: tab.said.append(str(error)))
    tab.on("request", lambda request: tab.asked.append(request.url))
    tab.goto(path.as_uri())
    return tab


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [420, 768, 1280])
def test_everything_is_drawn_and_nothing_clipped(browser, path, width, scheme):
    start = time.monotonic()
    tab = opened(browser, path, width, scheme)
    assert time.monotonic() - start < 5  # 0.3 s on an idle machine
    assert tab.said == [] and tab.asked == [path.as_uri()]
    charts = tab.eval_on_selector_all(".chart", "all => all.map(one => one.dataset.drawn)")
    assert charts == ["yes"] * 9
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    dark = tab.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert dark == (scheme == "dark")
    tab.close()


def test_hover_has_units_and_drag_zooms(browser, path):
    tab = opened(browser, path)
    place = tab.locator(".chart").first
    box = place.locator(".u-over").bounding_box()
    tab.mouse.move(box["x"] + 100, box["y"] + 50)
    tab.wait_for_timeout(200)
    assert " mm" in place.locator(".u-legend").inner_text()
    before = place.locator("canvas").evaluate("canvas => canvas.toDataURL()")
    tab.mouse.down()
    tab.mouse.move(box["x"] + 200, box["y"] + 60, steps=5)
    tab.mouse.up()
    tab.wait_for_timeout(200)
    assert place.locator("canvas").evaluate("canvas => canvas.toDataURL()") != before
    assert tab.said == []
    tab.close()


def test_paper_is_white_and_no_wider_than_a_sheet(browser, path):
    tab = opened(browser, path, scheme="dark")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    widest = "Math.max(...[...document.querySelectorAll('.uplot')].map(e => e.clientWidth))"
    assert tab.evaluate(widest) <= 640
    assert tab.pdf(format="A4")[:4] == b"%PDF"
    tab.close()
