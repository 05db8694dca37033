"""The page of the C interface, from the comments of palpate.h."""

from __future__ import annotations

import re
from pathlib import Path

HEADER = Path(__file__).resolve().parents[2] / "crates/capi/include/palpate.h"
HEAD = """# C interface

Every function, struct and constant of `palpate.h`. [C and C++](../c-api.md) shows how they are used. This page is
generated from the header.
"""
# Handles of the library that have no members.
OPAQUE = re.compile(r"typedef struct (\w+) \1;")
FUNCTION = re.compile(r"[\w ]+?\**(palpate_\w+)\((.*?)\);", re.DOTALL)


def page() -> str:
    """Write the page; a name without a comment is an error."""
    text = HEADER.read_text()
    opening, body = text.split("#define PALPATE_H\n", 1)
    parts: dict[str, list[str]] = {"Functions": [], "Structs": [], "Handles": [], "Status": [], "Constants": []}
    for comment, declaration in blocks(body):
        chapter, shown = entry(comment, declaration)
        parts[chapter].append(shown)
    chapters = (f"## {chapter}\n\n" + "\n".join(entries) for chapter, entries in parts.items())
    return "\n".join([HEAD, "## Rules\n", rules(opening), *chapters])


def rules(opening: str) -> str:
    """Text at the head of the header, a paragraph each."""
    lines = [
        line.strip().removeprefix("*").strip() for line in opening.split("/*", 1)[1].split("*/", 1)[0].splitlines()
    ]
    paragraphs = [part.strip() for part in "\n".join(lines).split("\n\n") if part.strip()]
    kept = [part for part in paragraphs if "This file is generated" not in part and not part.startswith("Palpate:")]
    return "\n\n".join(re.sub(r"\n(?=palpate_\w+ {2,})", "\n- ", part).replace("_", "\\_") for part in kept) + "\n"


def blocks(body: str) -> list[tuple[str, str]]:
    """Comments of lines that begin with two slashes, each with the declaration that follows."""
    body = re.sub(r"^ *#(if|ifdef|ifndef|else|elif|endif|include)\b.*\n", "", body, flags=re.MULTILINE)
    # The type of an enumeration's values is fixed in C++ and C23 alone; other versions have a second name.
    body = re.sub(
        r"^  : int32_t\n|^typedef (enum palpate_status|int32_t) palpate_status;\n", "", body, flags=re.MULTILINE
    )
    found: list[tuple[str, str]] = []
    comment: list[str] = []
    declaration: list[str] = []
    for line in body.splitlines():
        if not declaration and line.startswith("//"):
            comment.append(line.removeprefix("//").strip())
        elif declaration or (line.strip() not in ("", "{", "}") and not line.startswith(("extern", "}"))):
            declaration.append(line)
            if complete("\n".join(declaration)):
                found.append(("\n".join(comment), "\n".join(declaration)))
                comment, declaration = [], []
    return found


def complete(declaration: str) -> bool:
    """Whether a declaration has come to its end."""
    if declaration.startswith("#define"):
        return True
    open_braces = declaration.count("{") - declaration.count("}")
    return open_braces == 0 and declaration.rstrip().endswith(";")


def entry(comment: str, declaration: str) -> tuple[str, str]:
    """Chapter and text of one declaration."""
    name = name_of(declaration)
    if not comment:
        raise SystemExit(f"docs: {name} of palpate.h has no comment")
    text = f"{escaped(comment)}\n\n```c\n{declaration}\n```\n"
    if declaration.startswith("#define"):
        return "Constants", f"### `{name}`\n\n{text}"
    if declaration.startswith("enum"):
        return "Status", f"### `{name}`\n\n{text}"
    if OPAQUE.fullmatch(declaration):
        return "Handles", f"### `{name}`\n\n{escaped(comment)}\n"
    return ("Structs" if declaration.startswith("typedef struct") else "Functions"), f"### `{name}`\n\n{text}"


def name_of(declaration: str) -> str:
    """Name that a declaration declares."""
    if declaration.startswith("#define"):
        return declaration.split()[1]
    function = FUNCTION.search(declaration)
    if function and "{" not in declaration:
        return function[1]
    name = re.search(r"(?:enum|struct|typedef \w+) (palpate_\w+)", declaration)
    return name[1] if name else declaration.split("\n", maxsplit=1)[0]


def escaped(text: str) -> str:
    """Keep Markdown from reading signs of a comment as its own; code in backquotes stays."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([*_<>\[\]])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)
