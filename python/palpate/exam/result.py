"""Result of an exam: the Weber fraction, the hardest nodule that is found, and pass or fail."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.atomic import written_beside
from palpate.exam.course import Course
from palpate.exam.library import Library
from palpate.exam.psychometric import Estimate


@dataclass(frozen=True)
class Result:
    """Of a finished exam."""

    estimate: Estimate  # Weber fraction, its interval, lapses
    target: float  # probability of a right answer that the staircase sought
    felt_contrast: float  # found with that probability, `dK/K`; infinite for a hand that never is so sure
    # ``radius``, ``depth`` (m) and ``contrast``, `E/E0`, that is felt so, for each kind of nodule; ``contrast`` is None
    # where none of the exam's feels so soft or so hard.
    material_contrasts: tuple[dict[str, float | None], ...]
    # Over nodules: how many, how many right answers, how many times "none".
    trials: int
    right: int
    none: int
    # Trials with nothing hidden, and how many of them were marked all the same.
    blanks: int
    false_marks: int
    seconds: float  # all answers together
    passed: bool | None  # None where the file has no criterion

    @classmethod
    def of(cls, course: Course) -> Result:
        """Read the answers of a course."""
        question, estimate = course.library.exam.question, course.estimate()
        over = [answer for answer in course.answers if answer.trial.nodule is not None]
        blank = [answer for answer in course.answers if answer.trial.nodule is None]
        felt = estimate.contrast_at(question.target)
        criterion = question.pass_weber_fraction
        return cls(
            estimate,
            question.target,
            felt,
            tuple(_material_contrasts(course.library, felt)),
            len(over),
            sum(answer.correct for answer in over),
            sum(answer.marked is None for answer in over),
            len(blank),
            sum(answer.marked is not None for answer in blank),
            sum(answer.seconds for answer in course.answers),
            None if criterion is None else estimate.weber_fraction <= criterion,
        )

    def lines(self) -> list[str]:
        """Return what a person reads."""
        e = self.estimate
        felt = "no felt stiffness"
        if np.isfinite(self.felt_contrast):
            felt = f"a felt stiffness {percent(self.felt_contrast)} above its surroundings"
        lines = [
            f"Weber fraction {fraction_text(e)}",
            f"{self.right} of {self.trials} nodules found, {self.none} answered 'none'; guesses would find 1 of "
            f"{e.alternatives}",
            f"found in {percent(self.target)} of trials: {felt}",
        ]
        for kind in self.material_contrasts:
            nodule = f"  radius {_millimetres(kind['radius'])}, {_millimetres(kind['depth'])} deep"
            hard = kind["contrast"]
            lines.append(f"{nodule}: " + (f"{hard:.3g} times as hard as the tissue" if hard else "beyond this exam"))
        if self.blanks:
            lines.append(f"{self.false_marks} of {self.blanks} bodies without a nodule were marked")
        if self.passed is not None:
            lines.append("passed" if self.passed else "not passed")
        return lines

    def to_json(self) -> dict[str, Any]:
        """Return all numbers; what is not bounded is null."""
        whole = asdict(self)
        for table, key in ((whole["estimate"], "high"), (whole, "felt_contrast")):
            table[key] = table[key] if np.isfinite(table[key]) else None
        return whole

    def write(self, path: Path) -> None:
        """Write all numbers as JSON."""
        with written_beside(path) as partial:
            partial.write_text(json.dumps(self.to_json(), indent=2) + "\n")


def _material_contrasts(library: Library, felt: float) -> list[dict[str, float | None]]:
    """`E/E0` that is felt as a contrast, between those of the exam on a logarithmic scale; the mean over places."""
    kinds: dict[tuple[float, float], list[float]] = {}
    for group in library.groups:
        first = library.nodules[int(group[0])]
        hard = np.array([library.nodules[int(rank)].contrast for rank in group])
        contrasts = library.staircase_contrasts[group]
        inside = contrasts[0] <= felt <= contrasts[-1]
        found = np.exp(np.interp(np.log(felt), np.log(contrasts), np.log(hard - 1.0))) + 1.0 if inside else np.nan
        kinds.setdefault((first.radius, first.depth), []).append(float(found))
    means = {kind: float(np.mean(found)) for kind, found in kinds.items()}
    return [
        {"radius": radius, "depth": depth, "contrast": mean if np.isfinite(mean) else None}
        for (radius, depth), mean in means.items()
    ]


def percent(part: float) -> str:
    """Part as per cent, to three digits."""
    return f"{100 * part:.3g} %"


def fraction_text(estimate: Estimate) -> str:
    """Weber fraction with its 95 % interval, or the bound that the answers give it."""
    low, high = percent(estimate.low), percent(estimate.high)
    if not np.isfinite(estimate.high):
        return f"above {low} (95 %)" if estimate.low > 0 else "not bounded by these answers"
    return f"{percent(estimate.weber_fraction)} ({low} to {high})" if estimate.low > 0 else f"below {high} (95 %)"


def _millimetres(length: float | None) -> str:
    return f"{1e3 * (length or 0.0):.3g} mm"
