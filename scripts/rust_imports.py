"""Which modules of a Rust crate name items of which others; re-exports are followed to the module with the item."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from import_circles import Names

# What is no code: comments, and strings and characters with what they contain.
NO_CODE = re.compile(
    r"""//[^\n]*|/\*.*?\*/|b?r(#*)".*?"\1|b?"(?:\\.|[^"\\])*"|b?'(?:\\.[^']*|[^'\\])'""", flags=re.DOTALL
)
TEST_ONLY = re.compile(r"#\[cfg\((?:all\()?test\b[^\]]*\]")
USE = re.compile(r"(?<![\w:])use ([^;]+);")
PATH = re.compile(r"(?<![\w:])\w+(?:::\w+)+")
ITEM = re.compile(r"\b(?:fn|struct|enum|union|trait|type|const|static|mod|macro_rules!)\s+(\w+)")
ROOTED = re.compile(r"crate\b|super\b|self\b")
OPENING, CLOSING = "([{", ")]}"


@dataclass
class File:
    """A file of a crate: what it defines, and what it names, as paths from the root of the crate.

    Attributes
    ----------
    module
        The module that it is.
    items
        Names that it defines.
    imports
        Paths of its ``use`` statements by the name that each has in the file.
    globs
        Modules of ``use module::*``.
    named
        Paths of the ``use`` statements and of the code.

    """

    module: Names
    items: set[str]
    imports: dict[str, Names] = field(default_factory=dict)
    globs: list[Names] = field(default_factory=list)
    named: set[Names] = field(default_factory=set)


def rust_modules(root: Path) -> dict[Names, Path]:
    """Find the file of each module of a crate by its ``src``."""
    modules = {}
    for path in sorted(root.rglob("*.rs")):
        parts = path.relative_to(root).with_suffix("").parts
        modules[parts[:-1] if parts[-1] in ("mod", "lib", "main") else parts] = path
    return modules


def rust_imports(modules: dict[Names, Path]) -> dict[Names, set[Names]]:
    """For each module of a crate, the modules whose items its file names.

    Paths begin with ``crate``, ``super``, ``self``, a module below the file, or a name from a ``use`` of the file:
    ``use crate::packed`` and then ``packed::read()``. A re-exported name counts for the module that re-exports it and
    for the module with the item. Code that is compiled for tests only is left out.
    """
    files = {module: read_file(path.read_text(), module, modules) for module, path in modules.items()}
    return {
        module: {other for names in file.named for other in modules_of(files, names)} - {module}
        for module, file in files.items()
    }


def read_file(text: str, module: Names, modules: dict[Names, Path]) -> File:
    """Read the names of a file that is the given module."""
    code = without_tests(NO_CODE.sub(" ", text))
    file = File(module, set(ITEM.findall(code)))
    # Those from the root first: others may begin with a name that they bring in.
    for statement in sorted(USE.findall(code), key=lambda statement: not ROOTED.match(statement)):
        for path, name in use_paths(statement):
            names = absolute(path, file, modules)
            if names is None:
                continue
            if name == "*":
                file.globs.append(names)
            else:
                file.imports[name] = names
            file.named.add(names)
    for path in PATH.findall(USE.sub(" ", code)):
        if (names := absolute(tuple(path.split("::")), file, modules)) is not None:
            file.named.add(names)
    return file


def without_tests(code: str) -> str:
    """Code without the items that are compiled for tests only."""
    while found := TEST_ONLY.search(code):
        code = code[: found.start()] + code[end_of_item(code, found.end()) :]
    return code


def end_of_item(code: str, start: int) -> int:
    """Where the item ends that starts here: behind its braces, or behind its semicolon."""
    depth = 0
    for at in range(start, len(code)):
        depth += (code[at] in OPENING) - (code[at] in CLOSING)
        if depth == 0 and code[at] in ";}":
            return at + 1
        if depth < 0:  # the last field of a struct
            return at
    return len(code)


def absolute(path: Names, file: File, modules: dict[Names, Path]) -> Names | None:
    """Path from the root of the crate; None for one that leaves the crate."""
    base, k = file.module, 0
    while k < len(path) and path[k] in ("crate", "super", "self"):
        base = {"crate": (), "super": base[:-1], "self": base}[path[k]]
        k += 1
    if k:
        return (*base, *path[k:])
    if path[0] in file.imports:
        return (*file.imports[path[0]], *path[1:])
    return (*file.module, *path) if (*file.module, path[0]) in modules else None


def modules_of(files: dict[Names, File], names: Names) -> Iterator[Names]:
    """Modules of a path: those that re-export it, and last the one with the item."""
    for _ in range(9):  # bounds the re-exports of one name
        module = next(names[:k] for k in range(len(names), -1, -1) if names[:k] in files)
        yield module
        rest = names[len(module) :]
        target = reexported(files, module, rest[0]) if rest else None
        if target is None:
            return
        names = (*target, *rest[1:])


def reexported(files: dict[Names, File], module: Names, name: str) -> Names | None:
    """Path behind a name that a module has from a `use`; None if it defines the name itself."""
    file = files[module]
    if name in file.imports:
        return file.imports[name]
    if name in file.items:
        return None
    for source in file.globs:
        behind = files.get(source)
        if behind and (name in behind.items or name in behind.imports or (*source, name) in files):
            return (*source, name)
    return None


def use_paths(statement: str) -> list[tuple[Names, str]]:
    """All paths of a `use` statement with braces, and the name that each has in the file."""
    statement = re.sub(r"\s+", " ", statement).strip()
    opening = statement.find("{")
    if opening < 0:
        path, _, name = statement.partition(" as ")
        names = tuple(part.strip() for part in path.split("::"))
        name = name.strip() or names[-1]
        if names[-1] == "*" or (names[-1] == "self" and len(names) > 1):
            return [(names[:-1], "*" if names[-1] == "*" else names[-2] if name == "self" else name)]
        return [(names, name)]
    head = tuple(name for name in statement[:opening].replace(" ", "").split("::") if name)
    parts, depth, start = [], 0, opening + 1
    for at in range(opening, len(statement)):
        depth += {"{": 1, "}": -1}.get(statement[at], 0)
        if (statement[at] == "," and depth == 1) or depth == 0:
            parts.append(statement[start:at])
            start = at + 1
        if depth == 0:
            break
    found = []
    for part in parts:
        for path, name in use_paths(part) if part.strip() else []:
            whole = path == ("self",)  # `use module::{self}`
            found.append((head if whole else (*head, *path), head[-1] if whole and name == "self" else name))
    return found
