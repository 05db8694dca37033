"""What a study has finished is taken up again, unless a byte of it has changed."""

from __future__ import annotations

from palpate.study.answers import Answers
from palpate.study.study import _AnswerFile


def test_no_changed_byte_of_a_finished_answer_is_taken(tmp_path):
    path = tmp_path / "finished.jsonl"
    answer = Answers(rows=[{"force [N]": 0.125, "press": 1}], notes=["a note"])
    with _AnswerFile(path) as finished:
        finished.keep("key", answer)
    content = path.read_bytes()
    with _AnswerFile(path) as finished:
        assert finished.known == {"key": answer}
    for at in range(len(content)):
        for change in (0x01, 0x10):
            path.write_bytes(content[:at] + bytes([content[at] ^ change]) + content[at + 1 :])
            with _AnswerFile(path) as finished:
                assert finished.known in ({}, {"key": answer})
