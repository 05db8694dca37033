"""Exams: a person finds hidden nodules by touch alone; the answers give the Weber fraction of the hand."""

from palpate.exam.course import Course
from palpate.exam.file import ExamFile
from palpate.exam.library import Library
from palpate.exam.observer import simulated_exam, simulated_exams
from palpate.exam.psychometric import contrast_at, estimate, proportion_correct
from palpate.exam.record import Record

__all__ = [
    "Course",
    "ExamFile",
    "Library",
    "Record",
    "contrast_at",
    "estimate",
    "proportion_correct",
    "simulated_exam",
    "simulated_exams",
]
