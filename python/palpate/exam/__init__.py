"""Exams: nodules hidden in a body, found by touch alone, and what that tells of a hand."""

from palpate.exam.course import Answered, Course, Trial
from palpate.exam.file import ExamFile
from palpate.exam.library import Library, Nodule
from palpate.exam.observer import Observer, observed, observed_many
from palpate.exam.psychometric import Estimate, contrast_at, estimate, proportion_correct
from palpate.exam.record import Record
from palpate.exam.result import Result

__all__ = [
    "Answered",
    "Course",
    "Estimate",
    "ExamFile",
    "Library",
    "Nodule",
    "Observer",
    "Record",
    "Result",
    "Trial",
    "contrast_at",
    "estimate",
    "observed",
    "observed_many",
    "proportion_correct",
]
