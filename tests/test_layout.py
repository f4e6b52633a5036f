"""Imports go one way, down the layout, and importing changes nothing."""

import ast
import graphlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "jaxfric"

# Each room imports only from rooms before it. A new file gets its place here, or the test says so.
ORDER = """
    units programs looks data terms signals models checks identification online simulation
    simulators explanation export fleet report validation cli __main__
""".split()

GUIDE = Path(__file__).parents[1] / "CONTRIBUTING.md"

FILES = sorted(PACKAGE.rglob("*.py"))


def module(path):
    """The dotted name inside the package; the package itself is the empty name."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {module(path) for path in FILES}


def imported(path):
    """The modules of this package that a file imports, at its top or inside a function."""
    here = path.relative_to(PACKAGE).parent.parts
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] == "jaxfric":
                    yield alias.name.partition(".")[2]
        elif isinstance(node, ast.ImportFrom):
            stem = (node.module or "").split(".") if node.module else []
            if node.level:
                stem = [*here[: len(here) - node.level + 1], *stem]
            elif stem[:1] == ["jaxfric"]:
                stem = stem[1:]
            else:
                continue
            for alias in node.names:
                longer = ".".join([*stem, alias.name])
                yield longer if longer in NAMES else ".".join(stem)


def room(name):
    return name.split(".")[0]


@pytest.mark.parametrize("path", FILES, ids=lambda path: module(path) or "__init__")
def test_imports_go_down_the_layout(path):
    here = room(module(path))
    if not here:
        assert "cli" not in map(room, imported(path)), "the library must not need the command line"
        return
    assert here in ORDER, f"{here} has no place in ORDER: put it after all that it imports"
    allowed = [*ORDER[: ORDER.index(here)], here]
    wrong = sorted({name for name in imported(path) if room(name) not in allowed and name})
    assert not wrong, f"{here} imports {', '.join(wrong)}, which stand after it in the layout"


def test_the_guide_says_where_everything_is():
    """Its table lists every package, from the bottom up, and nothing else."""
    listed = re.findall(r"^\| `jaxfric/(\w+)(?:/|\.py)` \|", GUIDE.read_text("utf-8"), re.MULTILINE)
    there = {
        path.stem for path in PACKAGE.iterdir() if path.name[:2] != "__" and path.name != "py.typed"
    }
    assert set(listed) == there
    assert listed == [name for name in ORDER if name in there]


def test_few_files_lie_at_the_top():
    assert len([path for path in PACKAGE.glob("*.py") if path.name[0] != "_"]) <= 3


def test_no_module_imports_itself_by_a_detour():
    graph = {module(path): set(imported(path)) - {module(path)} for path in FILES if module(path)}
    # A package re-exports its files and its files may name the package: no detour of interest.
    packages = {name for name in graph if any(other.startswith(f"{name}.") for other in graph)}
    inside = {
        name: {other for other in others if other not in packages and other}
        for name, others in graph.items()
    }
    list(graphlib.TopologicalSorter(inside).static_order())  # raises CycleError


def run(code):
    found = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr


def test_importing_changes_no_setting_of_jax():
    run(
        "import jax, equinox, optimistix\n"
        "before = dict(jax.config.values)\n"
        "import jaxfric, pkgutil, importlib\n"
        "for m in pkgutil.walk_packages(jaxfric.__path__, 'jaxfric.'):\n"
        "    if m.name.split('.')[1] not in ('__main__', 'cli'): importlib.import_module(m.name)\n"
        "after = dict(jax.config.values)\n"
        "assert before == after, {k for k in after if before.get(k) != after[k]}\n"
    )


def test_public_names_stay_what_they_are_whatever_was_imported_before():
    """A submodule of the same name (identify) must not hide the function."""
    run(
        "import importlib, pkgutil, types, jaxfric\n"
        "for m in pkgutil.walk_packages(jaxfric.__path__, 'jaxfric.'):\n"
        "    if m.name.split('.')[1] != '__main__': importlib.import_module(m.name)\n"
        "modules = ('devices', 'export', 'fleet', 'models', 'online', 'programs', 'scenario',\n"
        "           'signals', 'simulators', 'terms')\n"
        "hidden = [n for n in jaxfric.__all__ if n not in modules\n"
        "          and isinstance(getattr(jaxfric, n), types.ModuleType)]\n"
        "assert not hidden, hidden\n"
    )


@pytest.mark.skipif("cli" not in NAMES, reason="there is no command line yet")
def test_the_command_line_starts_without_jax():
    run("import sys, jaxfric.cli\nassert 'jax' not in sys.modules, 'importing the cli loads jax'")
