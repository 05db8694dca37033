"""Course of an exam: the next trial, the answers so far, and resuming after an interruption.

Everything follows from the seed and the answers: where the nodules of each trial lie is drawn from the seed and the
trial's number alone, and its contrast by the staircase from the answers before. So rows that are read back lead to the
trial at which an exam was interrupted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.exam.library import Library
from palpate.exam.psychometric import Estimate
from palpate.exam.staircase import Staircase


@dataclass(frozen=True)
class Trial:
    """One question."""

    number: int  # from 1
    nodule: int | None  # number of the nodule in the library; None for a trial with nothing hidden


@dataclass(frozen=True)
class TrialAnswer:
    """A trial and its answer, as a row of the table holds them."""

    trial: Trial  # what was asked
    marked: tuple[float, float, float] | None  # point of the surface (3,), m, in the frame of the body; None for "none"
    place: int | None  # number of the place closest to the mark; None without one
    distance: float | None  # from the mark to the place of the nodule, m; None without either
    score: float  # 1 for a right answer, 0 for a wrong one; "none" over a nodule is scored as a guess, `1/m`
    seconds: float  # from when the body could be touched to the answer

    @property
    def correct(self) -> bool:
        """Whether the answer is right."""
        return self.score == 1.0


class Course:
    """An exam of one person: bodies of a library, places and depths by a seed, and the answers so far."""

    def __init__(self, library: Library, seed: int):
        self.library, self.seed = library, seed
        question = library.exam.question
        # Those with nothing hidden too.
        self.count = question.trials + question.blanks
        order = np.random.default_rng([seed, 0]).permutation(self.count)
        self._blank = set(order[: question.blanks].tolist())
        felt = library.staircase_contrasts
        self._staircase = Staircase(float(felt.min()), float(felt.max()), question.target)
        self.answers: list[TrialAnswer] = []

    @property
    def trial(self) -> Trial | None:
        """The question that is to be answered; None at the end."""
        rank = len(self.answers)
        if rank == self.count:
            return None
        return Trial(rank + 1, None if rank in self._blank else self._chosen(rank))

    def _chosen(self, rank: int) -> int:
        """Nodule of a random place, radius and depth whose felt contrast is next to the staircase's."""
        library = self.library
        group = library.groups[int(np.random.default_rng([self.seed, 1, rank]).integers(len(library.groups)))]
        distance = np.abs(np.log(library.staircase_contrasts[group] / self._staircase.contrast))
        return int(group[distance.argmin()])

    def answer(self, marked: Sequence[float] | None, seconds: float) -> TrialAnswer:
        """Take the answer of the trial that is to be answered, and go on to the next."""
        answered = self.scored(marked, seconds)
        self.take(answered)
        return answered

    def take(self, answered: TrialAnswer) -> None:
        """Go on to the next trial."""
        if answered.trial.nodule is not None:
            self._staircase.answered(answered.score)
        self.answers.append(answered)

    def scored(self, marked: Sequence[float] | None, seconds: float) -> TrialAnswer:
        """Score an answer of the trial that is to be answered, which stays that."""
        trial, places = self.trial, self.library.places
        assert trial is not None, "the exam is over"
        point = None if marked is None else np.array(marked, dtype=float)
        place = None if point is None else places.closest(point)
        distance, score = None, float(point is None)
        if trial.nodule is not None:
            hidden = self.library.nodules[trial.nodule].place
            score = 1.0 / len(places.points) if place is None else float(place == hidden)
            distance = None if point is None else float(np.linalg.norm(point - places.points[hidden]))
        where = None if marked is None else (float(marked[0]), float(marked[1]), float(marked[2]))
        return TrialAnswer(trial, where, place, distance, score, seconds)

    def estimate(self) -> Estimate:
        """Weber fraction by the answers so far, over nodules."""
        asked = [(answer.trial.nodule, answer.score) for answer in self.answers if answer.trial.nodule is not None]
        which, scores = np.array([nodule for nodule, _ in asked], dtype=int), np.array([score for _, score in asked])
        return self.library.psychometrics.estimate(which, scores)
