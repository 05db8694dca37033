"""The check of the architecture finds what is planted: circles of imports, and imports against the order."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# A crate in which nothing is wrong: `scene` reads by `packed`, whose folder re-exports the items of its files.
CRATE = {
    "lib.rs": "mod packed;\nmod scene;\nmod tool;\npub use packed::read;\npub use scene::Scene;\n",
    "scene.rs": "use crate::tool::Tool;\npub struct Scene;\n",
    "tool.rs": "pub struct Tool;\n",
    "packed/mod.rs": "mod arrays;\nmod read;\npub use read::read;\n",
    "packed/read.rs": "use super::arrays::Arrays;\nuse crate::scene::Scene;\npub fn read() -> Scene { Scene }\n",
    "packed/arrays.rs": "pub struct Arrays;\n",
}

# A package in which nothing is wrong.
PACKAGE = {
    "__init__.py": "from palpate.body import Body\nfrom palpate.green import plan\n",
    "_native.pyi": "",
    "units.py": "",
    "body/__init__.py": "from palpate.body.body import Body\n",
    "body/body.py": "from palpate import _native, units\nclass Body: ...\n",
    "body/loads.py": "from palpate.body.body import Body\n",
    "green/__init__.py": "from palpate.green.plan import plan\n",
    "green/plan.py": "from palpate.body import Body\ndef plan(): ...\n",
    "cli/__init__.py": "from palpate.cli import app\n",
    "cli/app.py": "def run():\n    from palpate.green import plan\n",
}


@pytest.fixture
def check(monkeypatch, tmp_path):
    """The check, looking at a folder that holds a page and nothing else."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import check_architecture

    monkeypatch.setattr(check_architecture, "ROOT", tmp_path)
    order = ", ".join(f"`{name}`" for name in check_architecture.PYTHON_ORDER)
    (tmp_path / "ARCHITECTURE.md").write_text(order)
    return check_architecture


@pytest.fixture
def rust(check, tmp_path):
    """Problems of a crate: the one above with other files in the place of its own or beside them."""

    def problems(crate="planted", **planted):
        for name, text in (CRATE | planted).items():
            write(tmp_path / "crates" / crate / "src" / name, text)
        write(tmp_path / "crates" / crate / "Cargo.toml", "")
        return check.rust_import_problems()

    return problems


@pytest.fixture
def python(check, tmp_path):
    """Problems of a package: the one above with other files in the place of its own or beside them."""

    def problems(**planted):
        for name, text in (PACKAGE | planted).items():
            write(tmp_path / "python" / "palpate" / name, text)
        return check.python_import_problems()

    return problems


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


@pytest.fixture
def numbered(check, tmp_path):
    """Problems with the numbers of the chapters, all of them right but for a replacement in one of the files."""
    chapters = list(enumerate(check.CHAPTERS, 1))
    files = {
        "docs/theory.md": "".join(f"## {n}. Title\n\n`crates/core/src/{name}/`: text\n\n" for n, name in chapters),
        "ARCHITECTURE.md": "".join(f"| {n} `crates/core/src/{name}/` | text |\n" for n, name in chapters),
    }
    modules = {f"crates/core/src/{name}/mod.rs": f"//! Chapter {n} of docs/theory.md: text.\n" for n, name in chapters}

    def problems(name="", old="", new=""):
        for file, text in (files | modules).items():
            write(tmp_path / file, text.replace(old, new) if file == name else text)
        return check.chapter_number_problems()

    return problems


def test_chapters_that_are_numbered_alike_are_no_problem(numbered):
    assert numbered() == []


@pytest.mark.parametrize(
    ("page", "old", "new"),
    [
        ("docs/theory.md", "## 4.", "## 5."),
        ("docs/theory.md", "## 4. ", "## "),
        ("docs/theory.md", "/solver/", "/sparse/"),
        ("ARCHITECTURE.md", "4 `", "5 `"),
        ("ARCHITECTURE.md", "4 `", "`"),
        ("ARCHITECTURE.md", "/solver/", "/sparse/"),
    ],
)
def test_a_page_that_numbers_a_chapter_differently_is_found(numbered, page, old, new):
    (problem,) = numbered(page, old, new)
    assert problem.startswith(f"{page} has the chapters 1 element, 2 mesh, 3 fem, ")


def test_a_folder_that_numbers_its_chapter_differently_is_found(numbered):
    expected = ["crates/core/src/strain/mod.rs does not begin with '//! Chapter 8 of docs/theory.md:'"]
    assert numbered("crates/core/src/strain/mod.rs", "Chapter 8", "Chapter 9") == expected
    assert numbered("crates/core/src/strain/mod.rs", "//! Chapter 8 of docs/theory.md: t", "//! T") == expected


def test_a_folder_without_a_chapter_is_found(numbered, tmp_path):
    write(tmp_path / "crates/core/src/plasticity/mod.rs", "")
    assert numbered() == ["crates/core/src/plasticity/ is no chapter: name it in CHAPTERS"]


def test_sound_imports_are_no_problem(rust, python):
    assert rust() == []
    assert python() == []


@pytest.mark.parametrize(
    "text",
    [
        "use crate::packed;\npub struct Scene;\nfn load() -> Scene { packed::read() }\n",
        "use crate::packed as files;\npub struct Scene;\nfn load() -> Scene { files::read() }\n",
        "use crate::packed::{self, read};\npub struct Scene;\n",
        "use super::packed;\nuse packed::read::read;\npub struct Scene;\n",
        "pub struct Scene;\nfn load() -> Scene { crate::packed::read() }\n",
        "pub struct Scene;\nfn load(count: usize) { for _ in 0..crate::packed::read::COUNT {} }\n",
    ],
    ids=["path", "renamed", "self", "two statements", "code", "range"],
)
def test_a_circle_through_the_path_of_a_used_module_is_found(rust, text):
    (problem,) = rust(**{"scene.rs": text})
    assert problem.startswith("crates/planted has a circle of imports: packed/read.rs -> scene.rs, scene.rs -> packed/")


@pytest.mark.parametrize(
    ("reexport", "used"),
    [
        ("pub use arrays::Arrays;", "use crate::packed::Arrays;"),
        ("pub use arrays::Arrays as Numbers;", "use crate::packed::Numbers;"),
        ("pub use self::arrays::*;", "use crate::packed::Arrays;"),
        ("pub use self::arrays::Arrays;", "use super::packed::{Arrays};"),
    ],
    ids=["name", "renamed", "all", "own"],
)
def test_a_circle_of_folders_through_a_re_export_is_found(rust, reexport, used):
    """No two files import each other: the scene takes arrays, and it is another file that takes the scene."""
    folder = f"mod arrays;\nmod read;\npub use read::read;\n{reexport}\n"
    (problem,) = rust(**{"packed/mod.rs": folder, "scene.rs": f"{used}\npub struct Scene;\n"})
    assert "packed/read.rs -> scene.rs" in problem and "scene.rs -> packed/" in problem


@pytest.mark.parametrize("kind", ["pub use", "use", "pub(crate) use"])
def test_a_circle_through_a_re_export_of_the_parent_is_found(rust, kind):
    """Files below a `mod.rs` see whatever it uses, also what it does not make public."""
    folder = f"mod arrays;\nmod read;\n{kind} read::read;\n"
    arrays = "use super::read;\npub struct Arrays;\n"
    (problem,) = rust(**{"packed/mod.rs": folder, "packed/arrays.rs": arrays})
    assert problem.endswith("packed/arrays.rs -> packed/read.rs, packed/read.rs -> packed/arrays.rs")


def test_a_circle_in_a_crate_below_another_crate_is_found(rust):
    (problem,) = rust("emulators/vendor", **{"tool.rs": "use crate::scene::Scene;\npub struct Tool;\n"})
    assert problem == "crates/emulators/vendor has a circle of imports: scene.rs -> tool.rs, tool.rs -> scene.rs"


@pytest.mark.parametrize(
    "text",
    [
        "pub struct Tool;\n// See crate::scene::Scene.\n",
        'pub struct Tool;\nconst NAME: &str = "crate::scene::Scene";\n',
        "pub struct Tool;\n#[cfg(test)]\nmod tests {\n    use crate::scene::Scene;\n}\n",
        "pub struct Tool;\nfn scene() -> other::scene::Scene { other::scene::Scene }\n",
    ],
    ids=["comment", "string", "test", "other crate"],
)
def test_what_is_no_import_closes_no_circle(rust, text):
    assert rust(**{"tool.rs": text}) == []


def test_code_after_a_test_counts(rust):
    tool = "#[cfg(test)]\nmod tests;\npub struct Tool(crate::scene::Scene);\n"
    assert len(rust(**{"tool.rs": tool})) == 1


def test_chapters_import_earlier_ones_only(rust):
    planted = {"mesh/mod.rs": "use crate::simulation::step;\n", "simulation/mod.rs": "pub fn step() {}\n"}
    assert rust("core", **planted)[-1] == "core's mesh/mod.rs imports simulation, a later chapter"


@pytest.mark.parametrize(
    "text",
    [
        "from palpate.body.loads import Loads\nclass Body: ...\n",
        "class Body:\n    def loads(self):\n        from palpate.body.loads import Loads\n",
        "def loads():\n    import palpate.body.loads\n",
        "def loads():\n    from . import loads\n",
    ],
    ids=["top", "method", "module", "relative"],
)
def test_a_circle_of_python_modules_is_found(python, text):
    (problem,) = python(**{"body/body.py": text})
    assert "palpate.body.body -> palpate.body.loads, palpate.body.loads -> palpate.body.body" in problem


def test_a_circle_of_python_folders_is_found(python):
    """No two modules import each other; the function `plan` comes from the folder, not from the module of its name."""
    planted = {
        "green/sub/__init__.py": "from palpate.green.sub.one import one\n",
        "green/sub/one.py": "from palpate.green.plan import plan\ndef one(): ...\n",
        "green/sub/two.py": "",
        "green/plan.py": "def plan():\n    from palpate.green.sub.two import two\n",
    }
    (problem,) = python(**planted)
    assert "palpate.green.plan -> palpate.green.sub.two, palpate.green.sub.one -> palpate.green.plan" in problem


@pytest.mark.parametrize(
    "text",
    ["import palpate\n", "from palpate import Body\n", "from palpate import plan\n", "from .. import Body\n"],
    ids=["module", "name", "function of a module's name", "relative"],
)
@pytest.mark.parametrize("inside", [False, True], ids=["top", "function"])
def test_imports_of_the_public_names_are_found(python, text, inside):
    text = f"def run():\n    {text}" if inside else text
    (problem,) = python(**{"cli/app.py": text})
    assert problem == "palpate.cli.app imports palpate, the __init__.py of a folder in which it lies"


def test_imports_of_the_own_folder_are_found(python):
    (problem,) = python(**{"body/loads.py": "def loads():\n    from palpate.body import Body\n"})
    assert problem == "palpate.body.loads imports palpate.body, the __init__.py of a folder in which it lies"


def test_imports_against_the_order_are_found(python):
    """Also of the modules at the top, which come before all folders."""
    (problem,) = python(**{"body/loads.py": "def loads():\n    from palpate.green import plan\n"})[:1]
    assert problem == "palpate.body.loads imports palpate.green: green comes after body"
    (problem,) = python(**{"body/loads.py": "", "units.py": "def unit():\n    import palpate.cli\n"})[:1]
    assert problem == "palpate.units imports palpate.cli: cli comes after top"


@pytest.mark.parametrize("text", ["import benches\n", "def run():\n    from benches.tick import rows\n"])
def test_imports_of_what_is_not_installed_are_found(python, text):
    (problem,) = python(**{"units.py": text})
    assert "units.py imports benches" in problem and "not installed" in problem


def test_long_files_are_found_in_crates_below_another_crate(check, tmp_path):
    write(tmp_path / "crates/emulators/vendor/src/lib.rs", "\n" * 501)
    assert check.length_problems() == ["crates/emulators/vendor/src/lib.rs has more than 500 lines"]


@pytest.mark.parametrize("name", ["takeFrames", "TetMesh", "guarded_tick", "Settings::controls", "palpate.Error"])
def test_names_of_code_are_looked_for(check, name):
    assert check.CODE_NAME.fullmatch(name)


@pytest.mark.parametrize("text", ["step", "u_i", "mu F_n", "F/d", "liver"])
def test_words_and_symbols_are_no_names_of_code(check, text):
    assert not check.CODE_NAME.fullmatch(text)
