"""Studies: many bodies or materials, the same presses, one table."""

from palpate.study.result import StudyResult
from palpate.study.study import Study

__all__ = ["Study", "StudyResult"]
