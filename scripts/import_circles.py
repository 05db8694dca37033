"""Circles among modules that import each other, at every level of their tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from itertools import pairwise

# A module by its names from the root: `crate::green::plan` is ("green", "plan").
Names = tuple[str, ...]
Graph = Mapping[Names, Set[Names]]
# An import: the module that imports, and the module that it imports.
Import = tuple[Names, Names]


def is_below(module: Names, other: Names) -> bool:
    """Whether a module lies in another one."""
    return len(module) > len(other) and module[: len(other)] == other


def circles_of_siblings(graph: Graph) -> list[list[Import]]:
    """Circles among the modules of the same parent, each as the imports that close it.

    Imports of modules below a sibling count as the sibling's own. Two folders can therefore form a circle where no two
    files do, and re-exports cannot hide it. A parent and the modules in it are no siblings: they may use each other.
    """
    parents = sorted({module[:depth] for module in graph for depth in range(len(module))})
    found = []
    for parent in parents:
        steps = imports_of_siblings(graph, parent)
        for circle in circles({name: set(others) for name, others in steps.items()}):
            found.append([steps[one][other] for one, other in pairwise(circle)])
    return found


def imports_of_siblings(graph: Graph, parent: Names) -> dict[str, dict[str, Import]]:
    """For each module of a parent, the others of that parent which it imports, with one import as the example."""
    steps: dict[str, dict[str, Import]] = {}
    level = len(parent)
    for module in sorted(graph):
        if not is_below(module, parent):
            continue
        own = steps.setdefault(module[level], {})
        for other in sorted(graph[module]):
            if is_below(other, parent) and other[level] != module[level]:
                own.setdefault(other[level], (module, other))
    return steps


def circles(graph: Mapping[str, Set[str]]) -> Iterator[list[str]]:
    """One shortest circle through each name that is on one, each circle once, its first name again at the end."""
    found = set()
    for start in sorted(graph):
        behind: dict[str, str | None] = {start: None}
        waiting = [start]
        for name in waiting:
            if start in graph[name]:
                circle = [name]
                while (before := behind[circle[-1]]) is not None:
                    circle.append(before)
                if frozenset(circle) not in found:
                    found.add(frozenset(circle))
                    yield [*reversed(circle), start]
                break
            for other in sorted(graph[name] - behind.keys()):
                behind[other] = name
                waiting.append(other)
