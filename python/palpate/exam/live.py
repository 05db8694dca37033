"""Exam in the browser: one trial after another; each answer is written before the next body is shown."""

from __future__ import annotations

import base64
import time
from pathlib import Path
from typing import Any

from palpate.errors import ViewerError
from palpate.exam.course import Course
from palpate.exam.hidden_session import HiddenSession
from palpate.exam.plot import plot_exam
from palpate.exam.record import Record
from palpate.exam.result import Result
from palpate.scene import BuiltScene
from palpate.viewer.messages import flag
from palpate.viewer.server import Client, ViewerServer
from palpate.viewer.status import CancellableTask, error_message

# The tone is as loud as it gets at so many times the force over plain tissue at the exam's depth.
LOUDEST = 3.0


def finish(course: Course, folder: Path) -> Result:
    """Work out what an exam comes to, and write it beside the table: ``exam.json`` and ``exam.png``."""
    result = Result.of(course)
    result.write(folder / "exam.json")
    plot_exam(course, result, folder / "exam.png")
    return result


class ExamServer(ViewerServer):
    """Serves an exam that is not over; its ``result``, in ``folder`` with the table, is None until the last answer."""

    def __init__(self, course: Course, folder: Path, *, host: str, port: int):
        trial = course.trial
        assert trial is not None, "the exam is over"
        self._loud_force = LOUDEST * float(course.library.plain_forces.max())
        super().__init__(course.library.built(trial.nodule), host=host, port=port)
        self._course, self._folder, self._record = course, folder, Record(folder / "exam.csv")
        self._shown = trial.number
        # When the trial could first be answered; None until somebody is there.
        self._began: float | None = None
        self.result: Result | None = None

    def _make_session(self, built: BuiltScene) -> HiddenSession:
        return HiddenSession(built, self._loud_force)

    async def _send_greeting(self, client: Client) -> None:
        await super()._send_greeting(client)
        self._began = self._began or time.monotonic()
        client.send(self._exam_message())

    async def _command(self, message: dict[str, Any]) -> None:
        session = self._session
        assert isinstance(session, HiddenSession)
        if message["type"] == "answer":
            await self._answer(message, session)
        elif message["type"] == "cancel" or session.takes(message["type"]):
            await super()._command(message)
        else:
            raise ViewerError(f"an exam takes no '{message['type'][:40]}'")

    async def _answer(self, message: dict[str, Any], session: HiddenSession) -> None:
        """Score and write an answer, and show the next body, or the result."""
        found = flag(message, "found")
        trial = self._course.trial
        if trial is None:
            raise ViewerError("the exam is over")
        building = self.begin_building()
        try:
            # A body that could not be shown was not asked about.
            if trial.number == self._shown:
                touched = await self.call(lambda: session.touched) if found else None
                if found and touched is None:
                    raise ViewerError("touch the body first: a mark is where the tool touches it, or did last")
                seconds = time.monotonic() - (self._began or time.monotonic())
                answered = self._course.scored(touched, seconds)
                await self.call(self._write, answered)
                self._course.take(answered)
        except BaseException:
            self._building = None
            raise
        self.work(self._next_trial(building))

    def _write(self, answered: Any) -> None:
        try:
            self._record.add(self._course, answered)
        except OSError as error:
            raise ViewerError(f"the answer could not be written: {error.strerror or error}; give it again") from None

    async def _next_trial(self, building: CancellableTask) -> None:
        trial = self._course.trial
        if trial is None:
            await self._conclude(building)
        else:
            make = lambda: self._make_session(self._course.library.built(trial.nodule))  # noqa: E731
            await self.switch("Next trial", make, self._show_next, building)
        self.send_all(self._exam_message())

    def _show_next(self, session: Any) -> None:
        self.replace(session)
        trial = self._course.trial
        assert trial is not None
        self._shown, self._began = trial.number, time.monotonic()

    async def _conclude(self, building: CancellableTask) -> None:
        try:
            await self.with_session(lambda session: session.release())
            self.result = await building.run(lambda: finish(self._course, self._folder), lambda _: None)
            print("\n".join(self.result.lines()), flush=True)
        except Exception as error:
            self.send_all(error_message(error))
            self.send_all({"type": "error", "text": f"the answers are in {self._folder}"})
        finally:
            self.finish_building()

    def _exam_message(self) -> dict[str, Any]:
        """Where the exam stands; nothing in it depends on what is hidden."""
        course = self._course
        question, body = course.library.exam.question, self._session.built.bodies[0]
        places = body.points_to_scene(course.library.places.points).tolist() if question.show_places else []
        return {
            "type": "exam",
            "trial": min(len(course.answers) + 1, course.count),
            "trials": course.count,
            "places": places,
            "result": None if self.result is None else self._result_message(self.result),
        }

    def _result_message(self, result: Result) -> dict[str, Any]:
        picture = base64.b64encode((self._folder / "exam.png").read_bytes()).decode()
        return {"lines": result.lines(), "plot": f"data:image/png;base64,{picture}"}
