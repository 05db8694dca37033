"""Check that ARCHITECTURE.md is true: its folders exist, its dependency rules hold, files stay readable."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import tomllib

from import_circles import Graph, Names, circles_of_siblings
from python_imports import imported_names, imports_of_own_package, python_imports
from rust_imports import rust_imports, rust_modules

ROOT = Path(__file__).resolve().parent.parent
MAX_FILE_LINES = 500
MAX_PAGE_LINES = 100

# The chapters of core, numbered from 1; each may import earlier ones.
CHAPTERS = (
    "element",
    "mesh",
    "fem",
    "solver",
    "green",
    "capacitance",
    "contact",
    "strain",
    "dynamics",
    "simulation",
    "series",
)

# What the online part of core builds without.
OFFLINE_ONLY = {"faer", "metis-sys", "rayon"}

# What each crate must not depend on, and why.
FORBIDDEN = {
    "core": (
        {"pyo3", "numpy", "triple_buffer", "rtrb", "libc"},
        "core knows no Python, no clock and no hand-off",
    ),
    "devices": ({"pyo3", "numpy", "palpate-servo"}, "a driver knows poses and wrenches only"),
    "servo": ({"pyo3", "numpy"}, "the loop runs without Python"),
}

# Folders of the Python package, lowest first: each imports from those before it. The modules at its top come before
# all of them. The package itself, which exports the public names, comes after them.
PYTHON_ORDER = (
    *("segmentation", "mesh", "body", "fields", "green", "dynamics", "models", "scene", "devices", "simulation"),
    *("openigtlink", "palpation", "fitting", "environments", "sessions", "study"),
    *("viewer", "validation/plots", "exam", "validation/verify", "validation/ticks", "validation/doctor"),
    "cli",
)

PACKAGE = "the package itself"

# What in backquotes can only be a name of code: with `::` or a dot, in CamelCase, or words joined by underscores;
# symbols of formulas are shorter.
CODE_NAME = re.compile(
    r"\w+((::|\.)[A-Za-z_]\w*)+(\(\))?|[A-Za-z][a-z0-9]+([A-Z][a-z0-9]*)+|[a-z0-9]{2,}(_[a-z0-9]{2,})+(\(\))?"
)


def main() -> int:
    """Print every broken rule; the exit status is 1 if there is one."""
    problems = [
        *page_problems(),
        *chapter_number_problems(),
        *dependency_problems(),
        *length_problems(),
        *python_import_problems(),
        *rust_import_problems(),
        *small_build_problems(),
        *dead_name_problems(),
    ]
    for problem in problems:
        print(f"check_architecture: {problem}", file=sys.stderr)
    return 1 if problems else 0


def page_problems() -> list[str]:
    """Folders that ARCHITECTURE.md names and that do not exist, or that it leaves out."""
    page = (ROOT / "ARCHITECTURE.md").read_text()
    problems = []
    if len(page.splitlines()) > MAX_PAGE_LINES:
        problems.append(f"ARCHITECTURE.md is longer than {MAX_PAGE_LINES} lines")
    for name in re.findall(r"`([\w./-]+/)`", page):
        if not (ROOT / name).is_dir():
            problems.append(f"ARCHITECTURE.md names the folder {name}, which does not exist")
    chapters = [
        *ROOT.glob("crates/*"),
        *ROOT.glob("crates/core/src/*"),
        *ROOT.glob("python/palpate/*"),
        *ROOT.glob("*"),
    ]
    kept = {name.rpartition("/")[0] for name in tracked_files()}
    for folder in sorted(p.relative_to(ROOT).as_posix() for p in chapters if p.is_dir()):
        tracked = any(name == folder or name.startswith(f"{folder}/") for name in kept)
        if tracked and not folder.startswith(".") and f"`{folder}/" not in page:
            problems.append(f"ARCHITECTURE.md does not mention {folder}/")
    return problems


def chapter_number_problems() -> list[str]:
    """Chapters that docs/theory.md, ARCHITECTURE.md and the folders of core do not number alike."""
    chapters = [(str(number), name) for number, name in enumerate(CHAPTERS, 1)]
    core = ROOT / "crates/core/src"
    folders = {path.name for path in core.iterdir() if path.is_dir()}
    unnumbered = sorted(folders - set(CHAPTERS))
    problems = [f"crates/core/src/{name}/ is no chapter: name it in CHAPTERS" for name in unnumbered]
    pages = {
        "docs/theory.md": r"^## (\d+)\. .+\n\n`crates/core/src/(\w+)/`",
        "ARCHITECTURE.md": r"(\d+) `crates/core/src/(\w+)/`",
    }
    for page, pattern in pages.items():
        found = re.findall(pattern, (ROOT / page).read_text(), re.MULTILINE)
        if found != chapters:
            numbered = ", ".join(f"{number} {name}" for number, name in found)
            problems.append(f"{page} has the chapters {numbered or 'none'}, not those of CHAPTERS in their order")
    for number, name in chapters:
        start, module = f"//! Chapter {number} of docs/theory.md", core / name / "mod.rs"
        if not module.exists() or not module.read_text().startswith(f"{start}:"):
            problems.append(f"crates/core/src/{name}/mod.rs does not begin with '{start}:'")
    return problems


def tracked_files() -> list[str]:
    """Files that the repository keeps; all of them outside of a repository."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        return [p.relative_to(ROOT).as_posix() for p in ROOT.rglob("*") if p.is_file()]
    return listed.stdout.splitlines()


# All that a driver may know of the core.
DEVICE_TYPES = {"Pose", "Twist", "Wrench"}


def device_problems() -> list[str]:
    """Find uses of the core by drivers that go beyond the types of the trait."""
    problems = []
    for path in sorted((ROOT / "crates/devices").rglob("*.rs")):
        uses = re.sub(r"//.*", "", path.read_text())
        allowed = re.sub(r"\bpalpate_core::simulation::(\w+|\{[\w\s,]*\})", allowed_types, uses)
        if "palpate_core" in allowed:
            names = ", ".join(sorted(DEVICE_TYPES))
            problems.append(f"{path.relative_to(ROOT)} uses more of the core than {names}: a driver knows no bodies")
    return problems


def allowed_types(use: re.Match[str]) -> str:
    """Leave nothing of a use of the core that names types of the trait only."""
    names = set(re.findall(r"\w+", use[1]))
    return "" if names <= DEVICE_TYPES else use[0]


def dependency_problems() -> list[str]:
    """Dependencies that a crate's place forbids."""
    problems = device_problems()
    for crate, (forbidden, reason) in FORBIDDEN.items():
        manifest = ROOT / "crates" / crate / "Cargo.toml"
        if manifest.exists():
            used = set(tomllib.loads(manifest.read_text()).get("dependencies", {}))
            problems += [f"crates/{crate} must not depend on {name}: {reason}" for name in sorted(used & forbidden)]
    core = "\n".join(p.read_text() for p in (ROOT / "crates/core/src").rglob("*.rs"))
    problems += [
        f"crates/core uses {name}: it reads no clock" for name in ("Instant::now", "SystemTime") if name in core
    ]
    return problems


def python_import_problems() -> list[str]:
    """Circles among the modules of the Python package, and imports against the order of its folders.

    Imports inside functions and for type checkers count too.
    """
    problems = []
    order = ", ".join(f"`{name}`" for name in PYTHON_ORDER)
    if order not in " ".join((ROOT / "ARCHITECTURE.md").read_text().split()):
        problems.append(f"ARCHITECTURE.md does not give the order of the Python folders: {order}")
    graph = python_imports(ROOT / "python", "palpate")
    own_package = set(imports_of_own_package(graph))
    for module, imported in graph.items():
        problems += [
            f"{dotted(module)} imports {dotted(other)}: {python_folder(other)} comes after {python_folder(module)}"
            for other in sorted(imported)
            if (module, other) not in own_package and python_rank(other) > python_rank(module)
        ]
    problems += [
        f"{dotted(module)} imports {dotted(folder)}, the __init__.py of a folder in which it lies"
        for module, folder in sorted(own_package)
    ]
    for folder, imports in (("python/palpate", graph), ("benches", python_imports(ROOT, "benches"))):
        for circle in circles_of_siblings(imports):
            steps = ", ".join(f"{dotted(module)} -> {dotted(other)}" for module, other in circle)
            problems.append(f"{folder} has a circle of imports: {steps}")
    problems += [
        f"{path.relative_to(ROOT)} imports {dotted(source)}, which is not installed with the package"
        for path in sorted((ROOT / "python").rglob("*.py"))
        for source, _ in imported_names(ast.parse(path.read_text()), ())
        if source[:1] == ("benches",)
    ]
    return problems


def dotted(module: Names) -> str:
    """Write a Python module as imports do."""
    return ".".join(module)


def python_folder(module: Names) -> str:
    """Folder of a module in the order; "top" for the modules at the top of the package."""
    if module == ("palpate",):
        return PACKAGE
    if module == ("palpate", "__main__"):
        return PYTHON_ORDER[-1]
    path = "/".join(module[1:])
    known = next((name for name in PYTHON_ORDER if f"{path}/".startswith(f"{name}/")), None)
    return known or (path if (ROOT / "python" / "palpate" / path).is_dir() else "top")


def python_rank(module: Names) -> int:
    """Place of a module's folder in the order; an unknown folder comes first, so that all its imports are reported.

    The package itself comes last.
    """
    order = (*PYTHON_ORDER, PACKAGE)
    folder = python_folder(module)
    return order.index(folder) if folder in order else -1


def dead_name_problems() -> list[str]:
    """Names of code and files in backquotes on the pages for people that no source has any more.

    Fenced examples are left out.
    """
    sources = [ROOT / name for name in tracked_files() if name.endswith((".rs", ".py", ".pyi", ".ts", ".cs", ".toml"))]
    sources = [path for path in sources if path.exists()]
    files = {path.relative_to(ROOT).as_posix() for path in sources}
    words = set(re.findall(r"\w+", "\n".join(path.read_text() for path in sources)))
    problems = []
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]:
        if page.name == "CHANGELOG.md":
            continue  # it tells of what was, too
        text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
        for name in sorted(set(re.findall(r"`([^`\n]+)`", text))):
            if re.fullmatch(r"[\w./-]+\.(rs|py|ts)", name):
                dead = not any(f"/{file}".endswith(f"/{name}") for file in files)
            else:
                dead = bool(CODE_NAME.fullmatch(name)) and not set(re.findall(r"\w+", name)) <= words
            if dead:
                problems.append(f"{page.relative_to(ROOT)} names {name}, which no source has")
    return problems


def length_problems() -> list[str]:
    """Source files too long to be read in one go."""
    patterns = ("crates/**/src/**/*.rs", "python/**/*.py", "benches/**/*.py", "tests/**/*.py", "viewer/src/**/*.ts")
    sources = [p for pattern in patterns for p in ROOT.glob(pattern)]
    return [
        f"{p.relative_to(ROOT)} has more than {MAX_FILE_LINES} lines"
        for p in sources
        if len(p.read_text().splitlines()) > MAX_FILE_LINES
    ]


def rust_import_problems() -> list[str]:
    """Circles among the modules of a crate, and chapters of core that import later ones.

    Both files and folders can form a circle; a folder imports what any of its files imports. Re-exports are followed.
    A ``mod.rs`` or ``lib.rs`` may import from the files below it while they import from it.
    """
    problems = []
    for manifest in sorted((ROOT / "crates").rglob("Cargo.toml")):
        crate = manifest.parent.relative_to(ROOT / "crates").as_posix()
        files = rust_modules(manifest.parent / "src")
        graph = rust_imports(files)
        for circle in circles_of_siblings(graph):
            steps = ", ".join(" -> ".join(relative(files[module]) for module in step) for step in circle)
            problems.append(f"crates/{crate} has a circle of imports: {steps}")
        if crate == "core":
            problems += chapter_problems(files, graph)
    return problems


def relative(path: Path) -> str:
    """Name a file of a crate by its path below ``src``."""
    return path.as_posix().rpartition("/src/")[2]


def chapter_problems(files: dict[Names, Path], graph: Graph) -> list[str]:
    """Chapters of core that import later ones."""
    problems = []
    for module, used in graph.items():
        chapter, others = module[:1], {other[:1] for other in used}
        later = [name for (name,) in filter(None, others) if chapter and {*chapter, name} <= set(CHAPTERS)]
        problems += [
            f"core's {relative(files[module])} imports {name}, a later chapter"
            for name in sorted(later)
            if CHAPTERS.index(name) > CHAPTERS.index(chapter[0])
        ]
    return problems


def small_build_problems() -> list[str]:
    """Dependencies that only the offline part of core may bring."""
    command = ["cargo", "tree", "-p", "palpate-core", "--no-default-features", "-e", "normal", "--prefix", "none"]
    listed = subprocess.run([*command, "--offline"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        return [f"cargo tree fails: {listed.stderr.strip().splitlines()[-1]}"]
    names = {line.split(" ")[0] for line in listed.stdout.splitlines() if line}
    return [f"palpate-core without its feature 'offline' depends on {name}" for name in sorted(names & OFFLINE_ONLY)]


if __name__ == "__main__":
    sys.exit(main())
