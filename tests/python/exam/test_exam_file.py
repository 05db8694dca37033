"""The exam file: mistakes are told with key and line, and the ones that come with Palpate are read."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import refused, run
from exam_files import write_exam

import palpate
from palpate.exam import ExamFile

EXAMPLES = Path(__file__).parents[3] / "examples"
TOOL = '[tool]\nradius = "10mm"\n'


def test_the_exams_that_come_along_are_read():
    for exam in (ExamFile.default(), ExamFile.read(EXAMPLES / "exam.toml")):
        assert exam.view.strain_limit == 0.0
        assert exam.question.alternatives >= 4


def test_the_exam_of_the_page_on_exams_is_read(tmp_path):
    texts = [text.split("```")[0] for text in (EXAMPLES.parent / "docs/exam.md").read_text().split("```toml\n")[1:]]
    (tmp_path / "page.toml").write_text(texts[0])
    ExamFile.read(tmp_path / "page.toml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("trials = 3", "trails = 3"), r"exam.toml:25: unknown key 'exam.trails'; did you mean 'trials'\?"),
        (("trials = 3", "trials = 0"), "exam.toml:25: exam.trials: must be greater than or equal to 1, got 0"),
        (('press_depth = "4mm"\n', ""), "exam.toml:21: the key 'exam.press_depth' is missing"),
        (('"4mm"', '"4N"'), "exam.toml:23: exam.press_depth: unknown unit 'N'"),
        (("low = 1.4", "low = 0.5"), "exam.toml:17: nodule.contrast.low: must be greater than 1, got 0.5"),
        (("low = 1.4", "low = 50"), "exam.toml:16: nodule.contrast: high must be above low, got 50 and 40"),
        (('["19mm"]', '["9mm"]'), "exam.toml:12: nodule: a nodule of radius 0.011 m whose middle .* would stick out"),
        (("seed = 3", "target = 0.3"), "exam.toml:21: exam: target must be above the chance of a guess, 1 of 3"),
        (("seed = 3", "[exam.random]\ncount = 3"), "exam.toml:26: the key 'exam.random.low' is missing"),
        (("count = 5", "count = 5\nsteps = 2"), "exam.toml:20: unknown key 'nodule.contrast.steps'; known are low"),
        ((TOOL, TOOL.replace("[tool]", "[[tool]]") * 2), "exam.toml:11: tool: an exam has one tool"),
        ((TOOL, f"{TOOL}[dynamics]\n"), "exam.toml:11: dynamics: the body of an exam is at rest"),
        ((TOOL, f"{TOOL}[[loads]]\ngravity = [0, 0, -9.81]\n"), "exam.toml:11: loads: a body of an exam has none"),
    ],
    ids=lambda given: None,
)
def test_mistakes_are_told_with_key_and_line(change, message, tmp_path):
    with pytest.raises(palpate.SceneError, match=message) as raised:
        ExamFile.read(write_exam(tmp_path, change))
    assert "\n" not in str(raised.value)


def test_the_command_tells_a_mistake_in_one_line(tmp_path):
    path = write_exam(tmp_path, ("trials = 3", "trails = 3"))
    refused(run("exam", "nodule", path, cwd=tmp_path), "exam.toml:25", "exam.trails", "did you mean 'trials'?")
    refused(run("exam", "nodule", "absent.toml", cwd=tmp_path), "absent.toml: no such file")
    assert not (tmp_path / "exam").exists()
