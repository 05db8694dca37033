"""The generated pages of the reference hold every option, key and name, and refuse what has no text."""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import palpate
from palpate.scene.table import Table

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "_extensions"))

import c_pages  # noqa: E402
import command_pages  # noqa: E402
import python_pages  # noqa: E402
import result_tables  # noqa: E402
import scene_pages  # noqa: E402
import scene_sites  # noqa: E402

# Names of files and of modules in other languages that look alike.
FILES = {"palpate.wasm", "palpate.h", "palpate.pc"}
LONG = re.compile(r"--[a-z-]+")


@pytest.mark.slow
def test_every_option_of_every_command_is_on_its_page():
    """As `--help` prints them, which typer writes by another way."""
    page = command_pages.page()
    names = [name for name, _ in command_pages.commands(command_pages.app)]
    assert {"run", "precompute", "cache limit", "exam nodule"} <= set(names)
    for name in ("run", "precompute", "map", "exam nodule"):
        run = [sys.executable, "-m", "palpate", *name.split(), "--help"]
        help_text = subprocess.run(run, capture_output=True, text=True, check=True).stdout
        # Those at the start of a row; others are mentioned in texts.
        options = {
            option for row in re.findall(r"^ {2}(-.*?)(?: {2}| <|$)", help_text, re.M) for option in LONG.findall(row)
        }
        section = page.split(f"## palpate {name}\n")[1].split("\n## ")[0]
        assert len(options) > 5
        for option in sorted(options - {"--help"}):
            assert option in section, f"{name} {option}"


def test_an_option_without_a_text_is_refused():
    def silent(count: command_pages.typing.Annotated[int, typer.Option()] = 1) -> None:
        """Do something."""

    with pytest.raises(SystemExit, match="has no text for count"):
        command_pages.section("silent", silent)


def test_every_key_of_a_scene_is_on_its_page():
    page = scene_pages.page()
    for name, key in scene_pages.all_keys():
        section = page.split(f"# `{name}`\n")[1].split("\n## ")[0]
        assert f"| `{key}` |" in section, f"{name} {key}"
    # Every table that a scene takes stands in the list of tables.
    written = {cls for _, cls in scene_pages.TABLES}
    for field in palpate.Scene.model_fields.values():
        inner = [field.annotation, *command_pages.typing.get_args(field.annotation)]
        tables = {kind for kind in inner if isinstance(kind, type) and issubclass(kind, Table)}
        assert tables <= written, tables - written


def test_a_key_without_a_text_is_refused():
    class Silent(Table):
        """A table."""

        loud: int = 1
        """Has a text."""
        silent: int = 1

    with pytest.raises(SystemExit, match="the key 'silent' of"):
        scene_pages.section("##", "[silent]", Silent, {})


def test_every_function_of_the_header_is_on_its_page():
    page = c_pages.page()
    functions = set(c_pages.FUNCTION.findall(c_pages.HEADER.read_text()))
    assert len(functions) > 40
    assert not [name for name, _ in functions if f"### `{name}`" not in page]
    with pytest.raises(SystemExit, match="has no comment"):
        c_pages.entry("", "void palpate_silent(void);")


def test_every_public_name_has_a_place():
    page = python_pages.page()
    for name in palpate.__all__:
        assert f"palpate.{name}" in page


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs/tutorials").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_of_a_page_can_be_read(page):
    for block in re.findall(r"```(?:python|\{code-cell\} ipython3)\n(.*?)```", page.read_text(), re.DOTALL):
        compile(re.sub(r"^:tags:.*\n", "", block), page.name, "exec")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_of_a_page_exist_with_their_options(page):
    known = {
        name: {o for p in command_pages.parameters(name, command) for o in LONG.findall(p.name)}
        for name, command in command_pages.commands(command_pages.app)
    }
    for line in re.findall(r"^ {4}palpate .*|^palpate .*|`palpate [^`]*`", page.read_text(), re.MULTILINE):
        words = line.strip(" `").split("#")[0].split()[1:]
        if not words or words[0].startswith(("-", "<")) or words[0].isupper() or words[0] == "...":
            continue
        name = " ".join(words[:2]) if words[0] in ("cache", "exam") else words[0]
        assert name in known, line
        for option in LONG.findall(" ".join(words)):
            assert option in known[name], f"{option}: {line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_names_of_the_package_on_a_page_exist(page):
    for name in set(re.findall(r"\bpalpate((?:\.[A-Za-z_]\w*)+)", page.read_text())):
        thing, path = palpate, "palpate"
        for part in name.split(".")[1:]:
            path = f"{path}.{part}"
            if path in FILES:
                break
            thing = getattr(thing, part, None) or importlib.import_module(path)


RESULTS = ROOT / "docs" / "_results"


def test_a_name_without_a_docstring_is_refused(monkeypatch):
    def silent() -> None:
        pass

    monkeypatch.setattr(palpate, "silent", silent, raising=False)
    with pytest.raises(SystemExit, match=r"palpate\.silent has no docstring"):
        python_pages.directive("palpate.silent")
    monkeypatch.setattr(palpate, "__all__", [*palpate.__all__, "silent"])
    with pytest.raises(SystemExit, match="no chapter for silent"):
        python_pages.page()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tables_of_results_and_scenes_of_a_page_exist(page):
    for name, *chosen in map(str.split, re.findall(r"^```\{results\} (.*)$", page.read_text(), re.MULTILINE)):
        assert result_tables.markdown(RESULTS, name, chosen).count("|") > 20
    for name in re.findall(r"^```\{scene\} (.*)$", page.read_text(), re.MULTILINE):
        palpate.Scene.read(scene_sites.scene_files(ROOT / "docs")[name])


def test_a_table_of_results_has_its_figures_machine_and_commit(tmp_path):
    row = {"benchmark": "tip", "unit": "mm", "source": "", "tolerance": 0.01, "verdict": "FAIL", "error": 0.02}
    rows = [row | {"quantity": "tip", "computed": 4.08, "target": 4.0}]
    for case, error in (("left", 0.1), ("right", 0.3)):
        rows.append(row | {"quantity": f"{case}: gap", "computed": error, "target": 0.0, "error": error})
    record = {"command": "palpate verify", "date": "2026-11-24", "commit": "abc123", "rows": rows}
    record["machine"] = {"processor": "fast", "cpus": 2, "kernel": "6.1"}
    (tmp_path / "verify.json").write_text(json.dumps(record))
    text = result_tables.markdown(tmp_path, "verify", ["tip"])
    assert "| `tip` | tip | 4.08 mm | 4 mm | 2 % | 1 %, **missed** |" in text
    # Cases of one figure that should be zero are one row, with the worst of them.
    assert "|  | gap, worst of 2 cases | 0.3 mm | 0 mm |" in text and "left" not in text
    assert "24 November 2026, commit `abc123`, 2 processors (fast, kernel 6.1)" in text
    for wrong in (("verify", ["top"]), ("nothing", [])):
        with pytest.raises(ValueError, match="has no"):
            result_tables.markdown(tmp_path, *wrong)
