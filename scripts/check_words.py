"""Check the words of texts for people: habits that have to be read twice, long sentences, undefined terms.

Usage: python scripts/check_words.py [FILE ...]; without files all texts of the repository.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from functools import cache
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
    (
        r", for (?:(?!which|that|example)[\w'-]+ ){1,6}(is|are|was|were|has|have|had|may|would|can|cannot|needs?)\b",
        "write 'because', or a sentence of its own, instead of 'for'",
    ),
    (r"\b(whoever|whosoever)\b", "name the person or the thread"),
    (r"\bin earnest\b|\bhonest to\b|\bturned away\b|\bnothing to go by\b|\bdear in\b", "an image: say what is meant"),
    (r"\b(color|colors|gray|center|behavior|meter|meters|analyze|optimize|centered)\b(?! ?=)", "British spelling"),
    (r"\bno longer\b(?! than)|\b(any more|used to be)\b", "history belongs in CHANGELOG.md"),
)

# Terms of this project that a reader cannot know: docs/glossary.md must define them.
TERMS = (
    *("capacitance matrix", "Green's function", "half-space", "local law", "limit of strain", "safety stage"),
    *("touch region", "felt stiffness", "Weber fraction", "modal basis", "passivity", "wrench", "predicate", "store"),
    *("tick", "tool", "patch", "coupling", "nodule", "label map", "Newmark's scheme", "taxel", "pose", "neo-hookean"),
    *("stated error", "emulator", "notice"),
)
# Abbreviations that a page may use without a definition: those of computing and of medicine that every reader of these
# pages knows, and names of programs and of their makers. All others stand in the glossary.
KNOWN = set(
    """
    API CAD CPU CSV CT DICOM GPU JSON MRI OS SDK SI TOML UDP URL USB GB GHz MB IEEE
    GLB GPL AGPL LGPL MIT MP OBJ OFF PLY PNG STL SEG TRANSFORM
    AMD AVX BLAS CGAL CHAI CHOLMOD EPYC HXT LAPACK METIS MKL NETGEN NAFEMS PARDISO PLUS ROS SOFA WSL
    """.split()
)
ABBREVIATION = re.compile(r"\b[A-Z]{2,}\b")

# Sentences that are allowed although a pattern finds them: file, part of the sentence, reason. A whole file is never
# allowed.
ALLOWED = (("python/palpate/validation/verify/contact/closed_forms.py", "A = p0/E*", "four formulas"),)


def main() -> int:
    """Print every problem; the exit status is 1 if there is one."""
    files = [Path(name).resolve() for name in sys.argv[1:]] or list(texts())
    problems = [problem for path in files for problem in problems_of(path)]
    problems += undefined_terms()
    if len(sys.argv) == 1:
        problems += unused_exceptions()
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
    """Habits, long sentences and undefined abbreviations of one file."""
    name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
    defined = glossary() | KNOWN
    problems = []
    for sentence in sentences_of(path):
        if allowed(name, sentence.text):
            continue
        spoken = re.sub(r"`+[^`]*`+", "", sentence.text)
        where = f"{name}:{sentence.line}"
        # The same advice is given once a sentence.
        found = {
            reason: m[0] for pattern, reason in reversed(HABITS) if (m := re.search(pattern, spoken, re.IGNORECASE))
        }
        problems += [f"{where}: '{words}': {reason}" for reason, words in found.items()]
        if len(sentence.words) > MAX_WORDS:
            opening = " ".join(sentence.text.split()[:8])
            problems.append(f"{where}: {len(sentence.words)} words in one sentence: {opening} ...")
        if path.suffix == ".md":
            unknown = sorted(set(ABBREVIATION.findall(without_names(spoken))) - defined)
            problems += [f"{where}: docs/glossary.md does not define '{short}'" for short in unknown]
    return problems


def without_names(text: str) -> str:
    """Text without names of files and placeholders, such as CONTRIBUTING.md and FILE."""
    return re.sub(
        r"\b[\w-]+\.(md|rs|toml)\b|\b(FILE|ADDRESS\w*|THIRD-PARTY|CONTRIBUTING|ARCHITECTURE|CHANGELOG)\b", "", text
    )


def allowed(name: str, text: str) -> bool:
    """Whether the allow list has the sentence."""
    return any(name == file and part in text for file, part, _ in ALLOWED)


def unused_exceptions() -> list[str]:
    """Exceptions whose sentence is not there: a list that is not cleaned grows."""
    return [
        f"scripts/check_words.py allows '{part}' of {file}, which is not there"
        for file, part, _ in ALLOWED
        if not any(part in sentence.text for sentence in sentences_of(ROOT / file))
    ]


@cache
def glossary() -> frozenset[str]:
    """Return the terms that the glossary defines."""
    lines = (ROOT / "docs/glossary.md").read_text().splitlines()
    return frozenset(line.strip() for line in lines if line and not line.startswith((" ", "#", ":")))


def undefined_terms() -> list[str]:
    """Terms that the glossary does not define."""
    defined = {term.lower() for term in glossary()}
    return [f"docs/glossary.md does not define '{term}'" for term in TERMS if term.lower() not in defined]


if __name__ == "__main__":
    sys.exit(main())
