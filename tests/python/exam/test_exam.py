"""A whole exam: what is felt over each body, an observer of known Weber fraction, the table, and the page."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from browser import MARKS, Program, opened, settled_depth, state, until
from command_line import refused, run
from exam_files import PLACES, write_exam, write_slab

import palpate
from palpate.exam import Course, ExamFile, Library, Record, simulated_exams
from palpate.exam.hidden_session import HiddenSession
from palpate.exam.pressing import forces_at
from palpate.scene import BuiltScene
from palpate.viewer import messages


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exam")
    write_slab(folder)
    return folder


@pytest.fixture(scope="module")
def cached_library(folder):
    """The exam's library, its bodies in a cache of this module's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        return Library(ExamFile.read(write_exam(folder)), progress=False)


@pytest.fixture
def library(cached_library, folder, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    # Matplotlib looks at every font of the machine, for seconds, unless it finds what it wrote the last time.
    monkeypatch.setenv("MPLCONFIGDIR", str(Path.home() / ".cache" / "matplotlib"))
    return cached_library


def of_trials(library: Library, **changes) -> Library:
    """The same bodies for another exam."""
    other = object.__new__(Library)
    other.__dict__.update(library.__dict__)
    question = library.exam.question.model_copy(update=changes)
    other.exam = library.exam.model_copy(update={"question": question})
    return other


@pytest.mark.slow
def test_felt_contrasts_are_those_of_bodies_with_the_nodule_in_their_mesh(library):
    """Another way there: a Body with its region, the whole surface touchable, `f64`, and a press that lasts longer."""
    exam, place = library.exam, 1
    rank = next(i for i, nodule in enumerate(library.nodules) if nodule.place == place and nodule.contrast == 40)
    mesh = palpate.TetMesh.read(exam.folder / "slab.vtu")
    ball = palpate.shapes.Sphere((0.06, 0.02, 0.04 - 0.019), 0.011)
    soft = palpate.Material(10e3, 0.45, 1000.0)
    forces = []
    for contrast in (1 + 1e-9, 40.0):
        hard = palpate.Material(10e3 * contrast, 0.45, 1000.0)
        marked = mesh.with_regions({"hard": ball})
        body = palpate.Body(marked, material={0: soft, "hard": hard}, fixed=lambda p: p[:, 2] < 1e-3)
        green = palpate.precompute(body, precision="f64", progress=False)
        simulation = palpate.Simulation(BuiltScene.of(exam, body, green))
        heights = np.concatenate([np.linspace(1e-3, -4e-3, 400), np.full(800, -4e-3)]) + 0.01
        path = np.column_stack([np.full((len(heights), 2), PLACES[place][:2]), 0.04 + heights])
        forces.append(simulation.run(path)[-1, 2])
    assert library.felt_contrasts[rank] == pytest.approx(forces[1] / forces[0] - 1, rel=0.01)
    assert library.plain_forces[place] == pytest.approx(forces[0], rel=2e-3)
    # Harder is felt harder, and elsewhere hardly anything is.
    for group in library.groups:
        assert (np.diff(library.felt_contrasts[group]) > 0).all() and library.felt_contrasts[group[0]] > 0.01
    elsewhere = library.forces / library.plain_forces - 1
    elsewhere[np.arange(len(library.nodules)), [nodule.place for nodule in library.nodules]] = 0
    assert np.abs(elsewhere).max() < 5e-3


@pytest.mark.parametrize("weber_fraction", [0.04, 0.08])
def test_an_observer_of_known_weber_fraction_is_found(library, weber_fraction):
    exams = of_trials(library, trials=80)
    found = np.array([one.weber_fraction for one in simulated_exams(exams, weber_fraction, 40)])
    print(np.median(found), np.std(np.log(found)))
    assert np.median(found) == pytest.approx(weber_fraction, rel=0.15)
    assert np.std(np.log(found)) < 0.2
    # A tolerance that can fail: a hand of 1.4 times the fraction is not taken for this one.
    other = np.array([one.weber_fraction for one in simulated_exams(exams, 1.4 * weber_fraction, 20)])
    assert np.median(other) > 1.15 * weber_fraction


def test_an_interrupted_exam_goes_on_with_the_same_trials(library, tmp_path):
    exam = of_trials(library, trials=9, blanks=3)
    answers = [PLACES[0], None, PLACES[1], PLACES[2], (0.021, 0.058, 0.04), None]
    whole, record = Course(exam, 11), Record(tmp_path / "exam.csv")
    seen = []
    for point in answers:
        seen.append(whole.trial)
        record.add(whole, whole.answer(point, 1.25))
    again = record.resume(exam, None)
    assert [answer.trial for answer in again.answers] == seen and again.seed == 11
    assert again.trial == whole.trial and again.estimate() == whole.estimate()
    # Another seed, other trials; those that are blank are as many as asked for.
    asked = []
    while whole.trial is not None:
        asked.append(whole.answer(PLACES[0], 1.0))
    assert sum(answer.trial.nodule is None for answer in whole.answers) == 3 and len(whole.answers) == 12
    assert [t.nodule for t in seen] != [other_trial(exam, 12, k) for k in range(6)]


def test_a_row_that_was_not_written_to_its_end_is_asked_again(library, tmp_path):
    exam = of_trials(library, trials=9, blanks=3)
    course, file = Course(exam, 11), tmp_path / "exam.csv"
    for point in (PLACES[0], None, PLACES[1]):
        Record(file).add(course, course.answer(point, 1.25))
    whole = file.read_bytes()
    for lost in (1, 2, 4, 30):
        file.write_bytes(whole[:-lost])
        again = Record(file).resume(exam, None)
        assert len(again.answers) == 2 and whole.startswith(file.read_bytes())
        Record(file).add(again, again.answer(PLACES[1], 1.25))
        assert file.read_bytes() == whole and len(Record(file).resume(exam, None).answers) == 3
    file.write_bytes(whole[:-2] + b",7\r\n")
    with pytest.raises(palpate.SceneError, match=r"exam\.csv:4: more cells than columns"):
        Record(file).resume(exam, None)


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of the size of files")
def test_an_answer_that_a_full_disk_cut_short_is_given_again(library, tmp_path):
    import resource

    exam = of_trials(library, trials=9, blanks=3)
    course, file = Course(exam, 11), tmp_path / "exam.csv"
    Record(file).add(course, course.answer(PLACES[0], 1.25))
    whole, limits = file.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    answered = course.answer(None, 1.5)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 20, limits[1]))
    try:
        with pytest.raises(OSError, match=r"exam\.csv|File too large"):
            Record(file).add(course, answered)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert file.read_bytes() == whole
    Record(file).add(course, answered)
    assert len(Record(file).resume(exam, None).answers) == 2


def other_trial(library: Library, seed: int, rank: int) -> int | None:
    course = Course(library, seed)
    for _ in range(rank):
        course.answer(PLACES[0], 1.0)
    return course.trial.nodule


def test_answers_are_scored(library):
    course = Course(of_trials(library, trials=30, blanks=4), 5)
    while (trial := course.trial) is not None:
        hidden = None if trial.nodule is None else library.nodules[trial.nodule].place
        aside = None if hidden is None else np.add(PLACES[hidden], (0.003, -0.004, 0.0))
        right = course.scored(aside, 1.0)
        assert right.correct and (hidden is None or right.distance == pytest.approx(0.005))
        assert not course.scored(PLACES[(hidden or 0) - 1], 1.0).correct
        none = course.scored(None, 1.0)
        assert none.score == (1.0 if hidden is None else pytest.approx(1 / 3))
        course.take(right)


def test_tables_of_other_exams_are_refused(library, tmp_path):
    path = tmp_path / "exam.csv"
    course, record = Course(library, 5), Record(path)
    record.add(course, course.answer(PLACES[0], 1.0))
    text = path.read_text()
    with pytest.raises(palpate.SceneError, match="begun with the seed 5, not 6: give another --out"):
        record.resume(library, 6)
    place = text.splitlines()[1].split(",")[2]
    path.write_text(text.replace(f"1,5,{place},", f"1,5,{(int(place) + 1) % 3},"))
    with pytest.raises(palpate.SceneError, match=r"exam.csv:2: place is ., this exam has .: .* give another --out"):
        record.resume(library, None)
    path.write_text("time,force\n1,2\n")
    with pytest.raises(palpate.SceneError, match=r"exam.csv:1: not the table of an exam"):
        record.resume(library, None)
    path.write_text(text.replace("mark", "mark,x").replace("1,5", "one,5"))
    with pytest.raises(palpate.SceneError, match=r"more cells than columns"):
        record.resume(library, None)


def test_a_nodule_that_the_mesh_cannot_hold_is_refused(library, folder, tmp_path):
    write_slab_of = (folder / "slab.vtu").read_bytes()
    (tmp_path / "slab.vtu").write_bytes(write_slab_of)
    for change, message in (
        (('["11mm"]', '["1.5mm"]'), "nodule: .*(fill|no element)"),
        (('["19mm"]', '["11.5mm"]'), "an element of it reaches the surface: hide it deeper"),
        (("z > max - 1mm", "z > max + 1mm"), "exam.search: no free surface node satisfies"),
    ):
        with pytest.raises(palpate.SceneError, match=message):
            Library(ExamFile.read(write_exam(tmp_path, change)), progress=False)


def test_the_page_is_told_the_same_of_every_body(library):
    """Its scene is the same to the bit, and a frame tells where the tool is and how loud the tone is."""
    scenes = []
    for nodule in (None, 0, len(library.nodules) - 1):
        session = HiddenSession(library.built(nodule), loud_force=1.0)
        scenes.append(session.scene_message())
        session.close()
    assert scenes[0] == scenes[1] == scenes[2]
    header, arrays = messages.decode(scenes[0])
    assert header["bodies"][0]["regions"] == [] and header["bodies"][0]["youngs_modulus"] is None
    assert len(arrays["0/tets"]) == 0 and not arrays["0/free"].any()


def test_the_force_of_a_place_is_the_same_however_the_others_are_pressed(library):
    alone = type(library.places)(library.places.points[2:], library.places.normals[2:])
    built = library.built(3)
    together = forces_at(built, library.places, 0.004)
    assert forces_at(built, alone, 0.004)[0] == pytest.approx(together[2], rel=1e-6)


def test_an_observer_takes_an_exam_from_the_command_line(library, folder, tmp_path):
    path = write_exam(folder, ("trials = 3", "trials = 30"))
    result = run("exam", "nodule", path, "--observer", 0.06, "--out", "kim", cwd=tmp_path)
    assert result.returncode == 0 and "Weber fraction" in result.stdout, result.stderr
    data = json.loads((tmp_path / "kim/exam.json").read_text())
    assert data["trials"] == 30 and 0.01 < data["estimate"]["weber_fraction"] < 0.3
    assert len((tmp_path / "kim/exam.csv").read_text().splitlines()) == 31
    assert (tmp_path / "kim/exam.png").read_bytes().startswith(b"\x89PNG")
    refused(run("exam", "nodule", path, "--observer", 0.06, "--out", "kim", cwd=tmp_path), "exam.csv is there already")
    write_exam(folder)


@pytest.mark.browser
class TestPage:
    pytestmark = MARKS

    @pytest.mark.slow
    def test_a_short_exam_is_taken_by_touch_alone(self, library, folder, chromium, tmp_path):
        """Three trials: marked where the tone is loudest, the same again, and none; an interruption between."""
        path, out = write_exam(folder), tmp_path / "anna"
        received: list[str | bytes] = []
        program = Program(folder / "cache", "nodule", str(path), "--out", str(out), command="exam")
        try:
            with opened(chromium, program, (800, 500), received.append) as page:
                assert not page.locator("#readout").is_visible() and not page.locator("#legend").is_visible()
                assert page.locator("#plots").is_hidden() and page.locator("#show-colors").is_hidden()
                page.keyboard.press("m")
                page.get_by_text("touch the body first").wait_for()
                mark_the_loudest(page, trial=2)
        finally:
            interrupted(program)
        program = Program(folder / "cache", "nodule", str(path), "--out", str(out), command="exam")
        try:
            with opened(chromium, program, (800, 500), received.append) as page:
                assert state(page)["exam"]["trial"] == 2
                mark_the_loudest(page, trial=3)
                page.get_by_test_id("exam-none").click()
                until(page, lambda seen: seen["exam"]["finished"])
                page.get_by_test_id("exam-plot").wait_for()
                assert "of 3 nodules found, 1 answered 'none'" in page.get_by_test_id("exam-result").inner_text()
        finally:
            interrupted(program)
        rows = np.genfromtxt(out / "exam.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
        assert rows["correct"].tolist() == [1, 1, 0] and rows["answer"].tolist() == ["mark", "mark", "none"]
        assert (rows["distance_m"][:2] < 1.5e-3).all()
        gives_nothing_away(received)


def interrupted(program: Program) -> None:
    os.kill(program.process.pid, signal.SIGINT)
    output = program.process.communicate(timeout=20)[0]
    assert program.process.returncode == 0, output


def mark_the_loudest(page, trial: int) -> None:
    """Press every place equally deep, and mark where the tone is loudest."""
    loudness = [press_place(page, place) for place in PLACES]
    page.mouse.up()
    press_place(page, PLACES[int(np.argmax(loudness))])
    page.keyboard.press("m")
    until(page, lambda seen: seen["exam"]["trial"] == trial and not seen["exam"]["answering"])
    page.mouse.up()


def press_place(page, place) -> float:
    page.mouse.up()
    page.mouse.move(*page.evaluate("point => window.palpate.project(point)", list(place)))
    page.mouse.down()
    settled_depth(page)
    # The tool lags behind the depth that the pointer wants, and the forces ramp in.
    before, ticks = -1.0, -np.inf
    for _ in range(600):
        seen = state(page)
        if seen["ticks"] - ticks >= 200:
            now = seen["exam"]["loudness"]
            if now > 0 and abs(now - before) < 1e-3 * now:
                return now
            before, ticks = now, seen["ticks"]
        time.sleep(0.03)
    raise AssertionError("the tone does not settle")


def gives_nothing_away(received: list[str | bytes]) -> None:
    """Neither place, region nor contrast of a nodule is in what the page received."""
    kinds, scenes, computed = set(), set(), set()
    for message in received:
        if isinstance(message, str):
            text = json.loads(message)
            kinds.add(text["type"])
            if text["type"] == "exam":
                assert set(text) == {"type", "trial", "trials", "places", "result"} and len(text["places"]) == 3
            elif text["type"] == "settings":
                assert text["youngs_modulus"] == [None]
            elif text["type"] == "computed":
                computed.add(message)
            continue
        header, arrays = messages.decode(message)
        kinds.add(header["type"])
        if header["type"] == "scene":
            scenes.add(message)
            continue
        assert header["contacts"] == [] and header["strain"] == 0 and header["tools"][0]["force"] == [0, 0, 0]
        assert header["fields"][0]["largest"] == 0 and not header["interior"][0] and len(arrays["log"]) == 0
        assert not arrays["0/displacements"].any() and not arrays["0/scalar"].any()
    assert kinds >= {"exam", "scene", "frame", "welcome"} and kinds <= {
        *("exam", "scene", "frame", "welcome", "settings", "status", "error", "role", "computed")
    }
    # What may be touched is the same in every trial.
    assert len(computed) == 1
    # One scene for all trials, to the bit.
    assert len(scenes) == 1
