"""Simulated observer of known Weber fraction, for tests of an exam: the engine's forces with noise.

It presses every place to the exam's depth and feels the force `F_i (1 + w n_i)`, `n_i` standard normal and independent:
at a given depth that is the stiffness `K_i = F_i / d` with noise in proportion to it. It knows the body without nodules
well, and takes the place where the force is the largest part of what it is there. The standard deviation of one look
over what is looked at is `w`: that is the Weber fraction that :mod:`palpate.exam.psychometric` is to find.
"""

from __future__ import annotations

import numpy as np

from palpate.exam.course import Course
from palpate.exam.library import Library
from palpate.exam.psychometric import Estimate


def simulated_exam(library: Library, weber_fraction: float, seed: int) -> Course:
    """Take a whole exam by an observer."""
    course, noise = Course(library, seed), np.random.default_rng([seed, 2])
    while (trial := course.trial) is not None:
        forces = library.plain_forces if trial.nodule is None else library.forces[trial.nodule]
        felt = forces * (1.0 + weber_fraction * noise.standard_normal(len(forces)))
        place = int(np.argmax(felt / library.plain_forces))
        course.answer(library.places.points[place].tolist(), 0.0)
    return course


def simulated_exams(library: Library, weber_fraction: float, exams: int, seed: int = 0) -> list[Estimate]:
    """Estimates of so many exams by an observer, with seeds that follow each other."""
    return [simulated_exam(library, weber_fraction, seed + rank).estimate() for rank in range(exams)]
