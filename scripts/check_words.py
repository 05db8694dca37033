"""Check the words of texts for people: habits that have to be read twice, long sentences, undefined terms.

Usage: python scripts/check_words.py [FILE ...]; without files all texts of the repository.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from prose import Sentence, markdown, page_texts, python_texts

ROOT = Path(__file__).resolve().parent.parent
MAX_WORDS = 35

# Habits that make a reader start again: what to find, and what is wrong with it.
HABITS = (
    (r"\b(tells?|told)\b(?! apart)", "software does not tell: it prints, reports, raises, shows"),
    (r"\bof (which|whom)\b", "start a sentence of its own instead of 'of which'"),
    (
        r"[,;:] for (it|they|he|she|there|this|that|these|those|its|their|nothing|no|only|the \w+ (is|are|has|have))\b",
        "write 'because', or a sentence of its own, instead of 'for'",
    ),
    (r"\b(whoever|whosoever)\b", "name the person or the thread"),
    (r"\bin earnest\b|\bhonest to\b|\bturned away\b|\bnothing to go by\b|\bdear in\b", "an image: say what is meant"),
    (r"\b(color|colors|gray|center|behavior|meter|meters|analyze|optimize|centered)\b(?! ?=)", "British spelling"),
    (r"\bno longer\b(?! than)|\b(any more|used to be)\b", "history belongs in CHANGELOG.md"),
)

# Terms of this project that a reader cannot know. Where a page uses one, docs/glossary.md must define it.
TERMS = (
    *("capacitance matrix", "Green's function", "half-space", "local law", "limit of strain", "safety stage"),
    *("touch region", "felt stiffness", "Weber fraction", "modal basis", "passivity", "wrench", "predicate", "store"),
    *("tick", "tool", "patch", "coupling", "nodule", "label map", "Newmark's scheme"),
)

# What is allowed although a pattern finds it: file, part of the sentence, reason.
ALLOWED = (
    ("python/palpate/validation/verify/contact/closed_forms.py", "A = p0/E*", "four formulas"),
    ("docs/theory.md", "", "chapters with derivations; sentences carry formulas, and are split where they can be"),
    ("docs/accuracy.md", "", "tables and lists of measurements, with conditions in one sentence"),
    ("docs/benchmarks.md", "", "as docs/accuracy.md"),
    ("docs/haptics.md", "", "explanation with formulas"),
    ("docs/devices-stability.md", "", "explanation with formulas"),
    ("docs/dynamics.md", "", "explanation with formulas"),
)
# Checks that the files above are excused from; the habits hold for all.
EXCUSED = "sentence"


def main() -> int:
    """Print every problem; the exit status is 1 if there is one."""
    files = [Path(name).resolve() for name in sys.argv[1:]] or list(texts())
    problems = [problem for path in files for problem in problems_of(path)]
    problems += undefined_terms()
    for problem in problems:
        print(f"check_words: {problem}", file=sys.stderr)
    return 1 if problems else 0


def texts() -> Iterator[Path]:
    """All files with texts that a user meets."""
    yield ROOT / "README.md"
    yield from sorted(path for path in (ROOT / "docs").rglob("*.md") if not {"_build", "reference"} & set(path.parts))
    yield from sorted((ROOT / "python/palpate").rglob("*.py"))
    yield ROOT / "viewer/index.html"
    yield from sorted(path for path in (ROOT / "viewer/src").rglob("*.ts") if ".test." not in path.name)


def sentences_of(path: Path) -> Iterator[Sentence]:
    """Sentences of a file, by its kind."""
    kinds = {".md": markdown, ".py": python_texts}
    return kinds.get(path.suffix, page_texts)(path)


def problems_of(path: Path) -> list[str]:
    """Habits and long sentences of one file."""
    name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
    problems = []
    for sentence in sentences_of(path):
        spoken = re.sub(r"`+[^`]*`+", "", sentence.text)
        for pattern, reason in HABITS:
            found = re.search(pattern, spoken, re.IGNORECASE)
            if found and not allowed(name, sentence.text, "habit"):
                problems.append(f"{name}:{sentence.line}: '{found[0]}': {reason}")
        if len(sentence.words) > MAX_WORDS and not allowed(name, sentence.text, EXCUSED):
            opening = " ".join(sentence.text.split()[:8])
            problems.append(f"{name}:{sentence.line}: {len(sentence.words)} words in one sentence: {opening} ...")
    return problems


def allowed(name: str, text: str, kind: str) -> bool:
    """Whether the allow list has the sentence."""
    return any(name == file and part in text and (part or kind == EXCUSED) for file, part, _ in ALLOWED)


def undefined_terms() -> list[str]:
    """Terms that the glossary does not define."""
    glossary = (ROOT / "docs/glossary.md").read_text()
    defined = {line.strip().lower() for line in glossary.splitlines() if line and not line.startswith((" ", "#", ":"))}
    return [f"docs/glossary.md does not define '{term}'" for term in TERMS if term.lower() not in defined]


if __name__ == "__main__":
    sys.exit(main())
