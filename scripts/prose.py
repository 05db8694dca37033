"""Prose of the texts that people read: sentences of Markdown pages, of help texts and of messages."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Ends of sentences: not those of abbreviations, file names and numbers.
END = re.compile(r"(?<!\be\.g)(?<!\bi\.e)(?<!\bcf)(?<!\bet al)(?<!\b[A-Z])[.!?](?=[\s)]|$)")
WORD = re.compile(r"[A-Za-z][A-Za-z'’-]*|\d[\d.,]*")


@dataclass(frozen=True)
class Sentence:
    """A sentence and where it begins."""

    path: Path
    line: int
    text: str

    @property
    def words(self) -> list[str]:
        """Its words and numbers; code in backquotes is one word."""
        return WORD.findall(re.sub(r"`[^`]*`", "code", self.text))


def markdown(path: Path) -> Iterator[Sentence]:
    """Sentences of the paragraphs and lists of a page: no code, tables, formulas, headings."""
    yield from sentences(path, paragraphs(path.read_text()))


def paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """Paragraphs of a page with their lines."""
    lines = text.splitlines()
    start, block, fence = 0, [], ""
    if lines and lines[0] == "---":
        skip = lines.index("---", 1) + 1
        lines[:skip] = [""] * skip
    for number, line in enumerate([*lines, ""], 1):
        mark = re.match(r"\s*(```+|:::+)", line)
        if mark and not fence:
            fence = mark[1] if mark[1][0] == "`" or "toctree" in line or "glossary" in line else ""
        elif mark and line.strip() == fence:
            fence = ""
        is_text = not (fence or mark or line.strip() == "" or re.match(r"\s*([|#>!\[]{1}.*\||#|!\[|\[!|\||    )", line))
        item = re.match(r"\s*([-*]|\d+\.) ", line)
        if block and (not is_text or item):
            yield start, " ".join(block)
            block = []
        if is_text:
            start = start if block else number
            block.append(re.sub(r"^\s*([-*]|\d+\.) ", "", line).strip())


def plain(text: str) -> str:
    """Drop the marks of links, pictures and emphasis."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return text.replace("**", "").replace("\\", "")


def sentences(path: Path, blocks: Iterator[tuple[int, str]]) -> Iterator[Sentence]:
    """Split paragraphs at the ends of their sentences; items between semicolons and colons stay in one."""
    for line, block in blocks:
        for part in END.split(plain(block)):
            if len(part.split()) > 1:
                yield Sentence(path, line, part.strip())


def python_texts(path: Path) -> Iterator[Sentence]:
    """Help texts, messages and public docstrings of a Python module."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield from call_texts(path, node)
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            doc = ast.get_docstring(node)
            if doc:
                # Sections of numpydoc have lists that are no sentences.
                opening = re.split(r"\n\w[\w ]*\n-{3,}", doc)[0]
                blocks = ((node.lineno, " ".join(part.split())) for part in opening.split("\n\n"))
                yield from sentences(path, (b for b in blocks if "::" not in b[1]))


def call_texts(path: Path, call: ast.Call) -> Iterator[Sentence]:
    """Texts of an option's help, of an error that is raised and of a warning."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    is_message = name.endswith(("Error", "Warning", "BadParameter", "Refused")) or name in (
        "warn",
        "Option",
        "Argument",
    )
    if is_message:
        texts = [*call.args, *(k.value for k in call.keywords if k.arg == "help")]
        for text in texts:
            yield from sentences(path, iter([(call.lineno, joined(text))]))


def joined(node: ast.expr) -> str:
    """Text of a string; what is filled in is one word."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "x" for part in node.values)
    if isinstance(node, ast.BinOp):
        return joined(node.left) + joined(node.right)
    return ""


def page_texts(path: Path) -> Iterator[Sentence]:
    """Sentences between the quotes and tags of the page's TypeScript and HTML."""
    text = path.read_text()
    text = re.sub(r"/\*.*?\*/", lambda m: "\n" * m[0].count("\n"), text, flags=re.DOTALL)
    for number, line in enumerate(text.splitlines(), 1):
        code = re.sub(r"(^|\s)//.*", "", line)
        for found in re.findall(r'"([^"]*)"|`([^`]*)`|>([^<>{}]+)<', code):
            content = re.sub(r"\$\{[^}]*\}", "x", "".join(found))
            if len(content.split()) > 2:
                yield from sentences(path, iter([(number, content)]))
