"""The page of all commands, from typer: what each does, its arguments, options and examples."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, Literal

import typer
from tables import code, table
from typer.models import ArgumentInfo, OptionInfo

import palpate.cli  # noqa: F401  registers the commands
from palpate.cli.app import app

HEAD = """# Commands

Every command and every option of `palpate`. `palpate COMMAND --help` prints the same text. This page is generated from
the program.

`palpate` without a command opens an empty page, in which you set up a body. `palpate --version` prints the version.
"""
EXAMPLE = "Example: "
WORDS = {str: "text", Path: "path", int: "whole number", float: "number"}


def page() -> str:
    """Write the page; a command or an option without a text is an error."""
    named = list(commands(app))
    listed = ", ".join(f"[{name}](#palpate-{name.replace(' ', '-')})" for name, _ in named)
    return "\n".join([HEAD, f"{listed}\n", *(section(name, command) for name, command in named)])


def commands(group: typer.Typer, before: str = "") -> Iterator[tuple[str, Callable[..., Any]]]:
    """All commands of a group and of its groups, by their full name."""
    for command in group.registered_commands:
        assert command.callback is not None
        yield before + (command.name or command.callback.__name__.replace("_", "-")), command.callback
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        yield from commands(inner.typer_instance, f"{before}{inner.name or inner.typer_instance.info.name} ")


@dataclass(frozen=True)
class Parameter:
    """An argument or an option of a command: its row in a table."""

    is_option: bool
    name: str
    default: str
    meaning: str

    @property
    def row(self) -> tuple[str, str, str]:
        """Cells of the row."""
        return self.name, self.default, self.meaning


def section(name: str, command: Callable[..., Any]) -> str:
    """Write the section of one command."""
    text = inspect.getdoc(command)
    if not text:
        raise SystemExit(f"docs: 'palpate {name}' has no help text")
    paragraphs = [" ".join(part.split()) for part in text.split("\n\n")]
    prose = [text for text in paragraphs if not text.startswith(EXAMPLE)]
    examples = [text.removeprefix(EXAMPLE) for text in paragraphs if text.startswith(EXAMPLE)]
    parts = [f"## palpate {name}\n", *(f"{escaped(text)}\n" for text in prose)]
    parts += ["```console\n" + "\n".join(examples) + "\n```\n"] if examples else []
    found = parameters(name, command)
    arguments = [p.row for p in found if not p.is_option]
    options = [p.row for p in found if p.is_option]
    parts += [table(("argument", "default", "meaning"), arguments)] if arguments else []
    parts += [table(("option", "default", "meaning"), options)] if options else []
    return "\n".join(parts)


def parameters(command: str, function: Callable[..., Any]) -> list[Parameter]:
    """Arguments and options of a command, in their order."""
    hints = typing.get_type_hints(function, include_extras=True)
    rows = []
    for key, parameter in inspect.signature(function).parameters.items():
        found = [m for m in getattr(hints[key], "__metadata__", ()) if isinstance(m, (OptionInfo, ArgumentInfo))]
        if not found:
            continue  # the context
        if not found[0].help:
            raise SystemExit(f"docs: 'palpate {command}' has no text for {key}")
        shown = name_of(key, found[0], typing.get_args(hints[key])[0])
        given = default(parameter.default, found[0])
        rows.append(Parameter(isinstance(found[0], OptionInfo), shown, given, escaped(found[0].help)))
    return rows


def name_of(key: str, info: OptionInfo | ArgumentInfo, kind: Any) -> str:
    """Name of an argument or an option, with what it takes."""
    if isinstance(info, ArgumentInfo):
        return code((info.metavar or key).upper())
    names = ", ".join(code(part) for part in declared(info) or [f"--{key.replace('_', '-')}"])
    kinds = [part for part in typing.get_args(kind) or (kind,) if part is not NoneType]
    if typing.get_origin(kind) is Literal:
        kinds = [kind]
    takes = "" if kinds[0] is bool else info.metavar or word(kinds[0])
    return f"{names} {escaped(takes)}".strip()


def declared(info: OptionInfo | ArgumentInfo) -> list[str]:
    """Names that an option gives itself: under ``Annotated`` the first of them stands in the place of a default."""
    first = [info.default] if isinstance(info.default, str) else []
    return [*first, *(info.param_decls or ())]


def word(kind: Any) -> str:
    """Say in a word what an option takes."""
    if typing.get_origin(kind) is list:
        return f"{word(typing.get_args(kind)[0])}, several times"
    if typing.get_origin(kind) is Literal:
        return "|".join(map(str, typing.get_args(kind)))
    if isinstance(kind, type) and issubclass(kind, Enum):
        return "|".join(str(member.value) for member in kind)
    if kind not in WORDS:
        raise SystemExit(f"docs: an option of type {kind} has no word in command_pages.py")
    return WORDS[kind]


def default(value: Any, info: OptionInfo | ArgumentInfo) -> str:
    """Value that is taken where none is given."""
    if value is inspect.Parameter.empty:
        return "required"
    if value is None or value is False or value == ():
        return ""
    if value is True:
        return code((declared(info) or ["yes"])[0].split("/")[0])
    return code(str(value))


def escaped(text: str) -> str:
    """Keep Markdown from reading signs of a text as its own."""
    for sign in "\\*_<>[]":
        text = text.replace(sign, f"\\{sign}")
    return text.replace("--", "\\-\\-")
