"""What the README and CONTRIBUTING show works as shown."""

import importlib
import re
import tomllib
from pathlib import Path

import jax
import pytest

ROOT = Path(__file__).parents[1]
METHOD = "jaxfric/explanation/METHOD.md"
PROOF = "benchmarks/PROOF.md"
PAGES = ["README.md", "CONTRIBUTING.md"]


def blocks(page, language):
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_python_blocks_run_one_after_the_other(page, capsys):
    code = blocks(page, "python")
    assert code, f"{page} shows no code"
    space = {"__name__": page}
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        for block in code:  # as a user has it: without the strict settings of the tests
            exec(compile(block, page, "exec"), space)
    said = capsys.readouterr().out
    assert said.strip()
    rows = re.findall(r"^(\w+[+-]?) +([\d.]+) +([\d.]+)  \S+$", "".join(blocks(page, "text")), re.M)
    assert len(rows) == (9 if page == "README.md" else 0)
    for name, *shown in rows:  # on another processor a last digit may differ
        printed = re.search(rf"^{re.escape(name)} +([\d.]+) +([\d.]+)  ", said, re.M)
        assert printed, name
        assert list(map(float, printed.groups())) == pytest.approx(
            list(map(float, shown)), rel=0.05
        )


def test_links_lead_to_files():
    for page in [*PAGES, METHOD, PROOF]:
        path = ROOT / page
        for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", path.read_text("utf-8")):
            assert (path.parent / link).exists(), f"{page} links to {link}, which is not there"


def test_the_extras_named_are_those_there_are():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = extras["optional-dependencies"]
    commands = "".join(blocks("README.md", "sh"))
    for extra in re.findall(r"\.\[(\w+)\]", commands):
        assert extra in extras
    assert "pytest" in commands
    assert "jaxfric demo" in commands


def test_paths_and_options_of_the_commands_exist():
    for command in blocks("CONTRIBUTING.md", "sh"):
        for path in re.findall(r"(?<!\S)((?:tests|benchmarks|\.ci)(?:/[\w./]+)?)", command):
            assert (ROOT / path).exists(), path


@pytest.mark.slow
def test_the_pictures_of_the_method_are_drawn(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    script = importlib.import_module("method_pictures")
    monkeypatch.setattr(script, "FOLDER", tmp_path)
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        script.main()
    told = re.findall(r"\]\(pictures/(\w+\.svg)\)", (ROOT / METHOD).read_text("utf-8"))
    assert sorted(told) == sorted(path.name for path in tmp_path.iterdir())
    assert all(path.stat().st_size > 10_000 for path in tmp_path.iterdir())
