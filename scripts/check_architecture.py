"""Check that ARCHITECTURE.md is true: its folders exist, its dependency rules hold, files stay readable."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import tomllib

ROOT = Path(__file__).resolve().parent.parent
MAX_FILE_LINES = 500
MAX_PAGE_LINES = 100

# The chapters of core; each may import earlier ones.
CHAPTERS = ("element", "mesh", "fem", "solver", "green", "capacitance", "contact", "strain", "dynamics", "simulation")

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
# all of them, the package itself, which exports the public names, where its name stands. Benchmarks are a package of
# their own, which nothing of this one imports.
PYTHON_ORDER = (
    *("mesh", "body", "fields", "green", "dynamics", "models", "scene", "devices", "simulation", "palpation"),
    *("sessions", "study"),
    *("palpate", "viewer", "validation/plots", "exam", "validation/verify", "validation/ticks", "validation/doctor"),
    *("cli", "benches"),
)

# What in backquotes can only be a name of code: with `::` or a dot, in CamelCase, or words joined by underscores;
# symbols of formulas are shorter.
CODE_NAME = re.compile(
    r"\w+((::|\.)[A-Za-z_]\w*)+(\(\))?|[A-Z][a-z0-9]+([A-Z][a-z0-9]*)+|[a-z0-9]{2,}(_[a-z0-9]{2,})+(\(\))?"
)


def main() -> int:
    """Print every broken rule; the exit status is 1 if there is one."""
    problems = [
        *page_problems(),
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
    """Folders that the page names and nobody has."""
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
    """Circles among the modules of the Python packages, and imports against the order of their folders.

    Imports inside functions and for type checkers count too.
    """
    problems = []
    order = ", ".join(f"`{name}`" for name in PYTHON_ORDER)
    if order not in " ".join((ROOT / "ARCHITECTURE.md").read_text().split()):
        problems.append(f"ARCHITECTURE.md does not give the order of the Python folders: {order}")
    graph = python_import_graph({"palpate": ROOT / "python", "benches": ROOT})
    for module, imported in graph.items():
        problems += [
            f"{module} imports {other}: {python_folder(other)} comes after {python_folder(module)}"
            for other in sorted(imported)
            if python_rank(other) > python_rank(module)
        ]
    circle = first_circle(graph)
    if circle:
        problems.append(f"modules import each other: {' -> '.join(circle)}")
    return problems


def python_import_graph(packages: dict[str, Path]) -> dict[str, set[str]]:
    """Modules of packages, each below its folder, and the modules of these packages that each imports."""
    files = {}
    for package, root in packages.items():
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return {
        module: {
            known if known in files else known.rpartition(".")[0]
            for known in imported_names(path, module if path.stem == "__init__" else module.rpartition(".")[0])
            if known in files or known.rpartition(".")[0] in files
        }
        for module, path in files.items()
    }


def imported_names(path: Path, package: str) -> Iterator[str]:
    """Everything of the packages that a file imports, with the module it comes from; the compiled module aside."""
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = ".".join(package.split(".")[: len(package.split(".")) + 1 - node.level]) if node.level else ""
            source = ".".join(part for part in (above, node.module) if part)
            names = [f"{source}.{alias.name}" for alias in node.names]
        yield from (n for n in names if n.split(".")[0] in ("palpate", "benches") and n != "palpate._native")


def python_folder(module: str) -> str:
    """Folder of a module in the order; "top" for the modules at the top of the package."""
    package = module.partition(".")[0]
    if package in ("benches", module):
        return package
    if module == "palpate.__main__":
        return PYTHON_ORDER[-1]
    path = "/".join(module.split(".")[1:])
    known = next((name for name in PYTHON_ORDER if f"{path}/".startswith(f"{name}/")), None)
    return known or (path if (ROOT / "python" / "palpate" / path).is_dir() else "top")


def python_rank(module: str) -> int:
    """Place of a module's folder in the order; an unknown folder comes first, so that whatever it imports is told."""
    folder = python_folder(module)
    return PYTHON_ORDER.index(folder) if folder in PYTHON_ORDER else -1


def first_circle(graph: dict[str, set[str]]) -> list[str]:
    """Modules of the first circle of imports, its first one again at the end; empty if there is none."""
    finished: set[str] = set()

    def visit(module: str, path: list[str]) -> list[str]:
        if module in path:
            return [*path[path.index(module) :], module]
        if module not in finished:
            for other in sorted(graph[module]):
                if circle := visit(other, [*path, module]):
                    return circle
            finished.add(module)
        return []

    return next((circle for module in graph if (circle := visit(module, []))), [])


def dead_name_problems() -> list[str]:
    """Names of code and files in backquotes on the pages for people that no source has any more.

    Fenced examples are left out.
    """
    sources = [ROOT / name for name in tracked_files() if name.endswith((".rs", ".py", ".pyi", ".ts", ".toml"))]
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
    patterns = ("crates/*/src/**/*.rs", "python/**/*.py", "benches/*.py", "tests/**/*.py", "viewer/src/**/*.ts")
    sources = [p for pattern in patterns for p in ROOT.glob(pattern)]
    return [
        f"{p.relative_to(ROOT)} has more than {MAX_FILE_LINES} lines"
        for p in sources
        if len(p.read_text().splitlines()) > MAX_FILE_LINES
    ]


def rust_import_problems() -> list[str]:
    """Circles among the files of a crate, and chapters of core that import later ones.

    A file imports another one whose items it names by a path from `crate`, `super` or `self`, in `use` or in the code.
    A name that a `mod.rs` hands on (`pub use`) counts as the file behind it; what a `mod.rs` or `lib.rs` says of the
    files below itself does not count, nor do tests.
    """
    problems = []
    for root in sorted(ROOT.glob("crates/*/src")):
        graph = rust_imports(root)
        for circle in circles(graph):
            problems.append(f"{root.relative_to(ROOT)} has a circle of imports: {' -> '.join(circle)}")
        if root.parent.name != "core":
            continue
        for file, used in graph.items():
            chapter, others = file.split("/")[0], {name.split("/")[0] for name in used}
            later = [name for name in others if name in CHAPTERS and chapter in CHAPTERS]
            problems += [
                f"core's {file} imports {name}, a later chapter"
                for name in sorted(later)
                if CHAPTERS.index(name) > CHAPTERS.index(chapter)
            ]
    return problems


def rust_imports(root: Path) -> dict[str, set[str]]:
    """For each file of a crate, relative to its `src`, the files whose items it names."""
    modules = {}
    for path in sorted(root.rglob("*.rs")):
        parts = path.relative_to(root).with_suffix("").parts
        modules[parts[:-1] if parts[-1] in ("mod", "lib") else parts] = path
    handed_on = {module: {} for module in modules}
    paths = {module: rust_paths(path.read_text(), module) for module, path in modules.items()}
    for module, path in modules.items():
        if path.stem in ("mod", "lib"):
            # `pub use child::{A, B}`, relative to the module itself.
            for statement in re.findall(r"pub(?:\([^)]*\))? use ([^;]+);", path.read_text()):
                for names in use_paths(statement):
                    handed_on[module][names[-1]] = (*module, *names)

    def file_of(names: tuple[str, ...]) -> tuple[str, ...]:
        for _ in range(9):  # a name may be handed on several times
            module = next(names[:k] for k in range(len(names), -1, -1) if names[:k] in modules)
            target = handed_on[module].get(names[len(module)]) if len(names) > len(module) else None
            if target is None:
                return module
            names = target
        return module

    graph = {}
    for module, named in paths.items():
        own = str(modules[module].relative_to(root))
        below = modules[module].stem in ("mod", "lib")
        used = {file_of(names) for names in named}
        graph[own] = {
            str(modules[other].relative_to(root))
            for other in used
            if other != module and not (below and other[: len(module)] == module)
        }
    return graph


def rust_paths(text: str, module: tuple[str, ...]) -> set[tuple[str, ...]]:
    """Absolute paths that a file names, the crate's own, tests and comments left out."""
    text = re.split(r"#\[cfg\((?:all\()?test", text)[0]
    text = re.sub(r"//[^\n]*", "", text)
    found = set()
    statements = re.findall(r"\buse ([^;]+);", text)
    rest = re.sub(r"\buse [^;]+;", "", text)
    for names in [
        *(names for statement in statements for names in use_paths(statement)),
        *(tuple(path.split("::")) for path in re.findall(r"\b(?:crate|super|self)(?:::\w+)+", rest)),
    ]:
        if names[0] not in ("crate", "super", "self"):
            continue
        base, k = module, 0
        while k < len(names) and names[k] in ("crate", "super", "self"):
            base = {"crate": (), "super": base[:-1], "self": base}[names[k]]
            k += 1
        found.add((*base, *names[k:]))
    return found


def use_paths(statement: str) -> list[tuple[str, ...]]:
    """All paths of a `use` statement with braces."""
    statement = re.sub(r"\s+as\s+\w+", "", re.sub(r"\s+", " ", statement)).strip()
    opening = statement.find("{")
    if opening < 0:
        return [tuple(name.strip() for name in statement.split("::"))]
    head = tuple(name for name in statement[:opening].replace(" ", "").split("::") if name)
    parts, depth, start = [], 0, opening + 1
    for at in range(opening, len(statement)):
        depth += {"{": 1, "}": -1}.get(statement[at], 0)
        if (statement[at] == "," and depth == 1) or depth == 0:
            parts.append(statement[start:at])
            start = at + 1
        if depth == 0:
            break
    return [(*head, *path) for part in parts if part.strip() for path in use_paths(part.strip())]


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """One circle through each file that is on one, each circle once."""
    found = {}
    for start in sorted(graph):
        behind, waiting = {start: None}, [start]
        while waiting:
            file = waiting.pop(0)
            if start in graph[file]:
                circle = [file]
                while behind[circle[-1]] is not None:
                    circle.append(behind[circle[-1]])
                found.setdefault(frozenset(circle), [*circle[::-1], start])
                break
            for other in sorted(graph[file] - behind.keys()):
                behind[other] = file
                waiting.append(other)
    return list(found.values())


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
