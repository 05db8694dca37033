"""Which modules of a Python package import which others."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from import_circles import Names, is_below


def python_imports(root: Path, package: str) -> dict[Names, set[Names]]:
    """For each module of a package in a folder, the modules of it that it imports; compiled ones (.pyi) are left out.

    Imports inside functions and for type checkers count. As in Python, a name that the ``__init__.py`` of a folder
    exports comes before a module of the same name.
    """
    trees = {}
    for path in sorted((root / package).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        trees[parts[:-1] if parts[-1] == "__init__" else parts] = (path, ast.parse(path.read_text()))
    modules = set(trees)
    compiled = {path.relative_to(root).with_suffix("").parts for path in (root / package).rglob("*.pyi")}
    exported = {
        module: set(exported_names(tree, module, modules))
        for module, (path, tree) in trees.items()
        if path.stem == "__init__"
    }
    graph = {}
    for module, (path, tree) in trees.items():
        folder = module if path.stem == "__init__" else module[:-1]
        used = set()
        for source, name in imported_names(tree, folder):
            below = (*source, name)
            of_folder = below in modules and name not in exported.get(source, ())
            if of_folder or (source in modules and below not in compiled):
                used.add(below if of_folder else source)
        graph[module] = used - {module}
    return graph


def exported_names(tree: ast.Module, module: Names, modules: set[Names]) -> Iterator[str]:
    """Names that an ``__init__.py`` exports, other than the modules of its folder."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (target.id for target in targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.ImportFrom):
            source = source_of(node, module)
            for alias in node.names:
                if not (source == module and (*source, alias.name) in modules):
                    yield alias.asname or alias.name


def imported_names(tree: ast.Module, folder: Names) -> Iterator[tuple[Names, str]]:
    """Every import of a file: the module, and the name that is taken from it, empty where none is."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((tuple(alias.name.split(".")), "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = source_of(node, folder)
            yield from ((source, alias.name) for alias in node.names)


def source_of(node: ast.ImportFrom, folder: Names) -> Names:
    """Names of the module that an import names from the folder of its file."""
    above = folder[: len(folder) + 1 - node.level] if node.level else ()
    return (*above, *(node.module.split(".") if node.module else ()))


def imports_of_own_package(graph: dict[Names, set[Names]]) -> Iterator[tuple[Names, Names]]:
    """Modules that import a package in which they lie, and that package."""
    for module, used in graph.items():
        yield from ((module, other) for other in sorted(used) if is_below(module, other))
