"""The documentation names what there is, and its pages run."""

import functools
import io
import re
import types
from pathlib import Path

import jax
import pytest

import jaxfric as jf
from jaxfric.terms.base import AbstractTerm
from jaxfric.terms.effects import EFFECTS

PAGES = Path(__file__).parents[1] / "docs" / "pages"
BLOCK = re.compile(r"^```python exec=\"on\"[^\n]*\n(.*?)^```$", re.M | re.S)


@pytest.fixture(autouse=True)
def beside_the_pages(monkeypatch):
    """As docs/hooks.py has it."""
    monkeypatch.syspath_prepend(PAGES.parent)


def blocks(page):
    return BLOCK.findall((PAGES / page).read_text("utf-8"))


def run(page):
    """What each block of a page prints, in one session as the site has it."""
    session, said = {"__name__": "page"}, []
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        for block in blocks(page):
            # As the site has it: what a block prints itself, not what it calls.
            out = io.StringIO()
            session["print"] = functools.partial(print, file=out)
            exec(compile(block, page, "exec"), session)
            said.append(out.getvalue())
    return session, said


def test_the_reference_has_every_public_name():
    text = (PAGES / "reference" / "python.md").read_text("utf-8")
    directives = re.findall(r"^::: jaxfric\.(\S+)$", text, re.M)
    for name in directives:
        found = jf
        for part in name.split("."):
            found = getattr(found, part)
        assert found.__doc__, name
    bare = {name for name in jf.__all__ if not isinstance(getattr(jf, name), types.ModuleType)}
    assert bare <= set(directives)
    modules = set(jf.__all__) - bare - {"terms"}  # a page of its own
    assert modules <= {name.split(".")[0] for name in directives}


def test_the_reference_has_every_term():
    text = (PAGES / "reference" / "terms.md").read_text("utf-8")
    directives = set(re.findall(r"^::: jaxfric\.terms\.(\S+)$", text, re.M))
    kinds = {name: kind for name, kind in vars(jf.terms).items() if isinstance(kind, type)}
    terms = {name for name, kind in kinds.items() if issubclass(kind, AbstractTerm)}
    assert directives == {name for name in terms if not name.startswith("Abstract")}


def test_every_page_is_in_the_navigation():
    listed = re.findall(r": (\S+\.md)$", (PAGES.parent / "mkdocs.yml").read_text("utf-8"), re.M)
    assert set(listed) == {str(page.relative_to(PAGES)) for page in PAGES.rglob("*.md")}


def test_the_reference_shows_every_command_and_every_effect():
    session, (said,) = run("reference/commands.md")
    for name in session["names"]:
        assert f"## jaxfric {name}\n\n```text\nusage: jaxfric {name}" in said
    assert {"identify", "explain", "fleet", "watch"} <= set(session["names"])
    (said,) = run("reference/effects.md")[1]
    assert all(f"## {effect.name.replace('_', ' ')}\n" in said for effect in EFFECTS.values())


@pytest.mark.slow
def test_identify_my_axis():
    session, said = run("identify.md")
    text = "".join(said)
    assert "result successful" in text
    # 95 %; two deviations below, of 64 draws: the errors of one direction of a log go together.
    assert 0.89 < session["inside"] / session["total"] <= 1.0
    assert "not_passive" in text or "contradictory" in text  # the wrong sign
    assert sum("data:image/png" in each for each in said) == 2


@pytest.mark.slow
def test_my_simulator_and_my_robot_differ():
    session, said = run("explain.md")
    found = session["found"]
    assert found.verdict == "explained"
    moved = found.findings[0].parameters
    assert abs(float(moved["stiffness"].value) - 1.5) < 0.01
    assert said[-1].strip() == "consistent"


@pytest.mark.slow
def test_a_fleet_in_the_night_shift():
    session, said = run("fleet.md")
    assert [row["result"] for row in session["rows"]] == ["successful"] * 8
    assert "machine=b" in "".join(said)


@pytest.mark.slow
def test_inside_a_larger_program():
    session, _ = run("pipeline.md")
    assert abs(session["slope"] / session["step"] - 1) < 0.01
