"""Exams: a person finds hidden nodules by touch alone; the answers give the Weber fraction of the hand."""

from palpate.exam.course import Course, Trial, TrialAnswer
from palpate.exam.file import ExamFile
from palpate.exam.library import Library, Nodule
from palpate.exam.observer import simulated_exam, simulated_exams
from palpate.exam.psychometric import Estimate, contrast_at, estimate, proportion_correct
from palpate.exam.record import Record
from palpate.exam.result import Result

__all__ = [
    "Course",
    "Estimate",
    "ExamFile",
    "Library",
    "Nodule",
    "Record",
    "Result",
    "Trial",
    "TrialAnswer",
    "contrast_at",
    "estimate",
    "proportion_correct",
    "simulated_exam",
    "simulated_exams",
]
