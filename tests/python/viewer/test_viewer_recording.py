"""Recordings begun from the page, and their replay in it."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest
from browser import MARKS, Program, eventually, opened, press, settled_force, state, until

import palpate

pytestmark = MARKS


@pytest.fixture(scope="module")
def recorded(chromium, cache, tmp_path_factory):
    """A press that was recorded by the button, its file, and the force when it had settled."""
    folder = tmp_path_factory.mktemp("recordings")
    program = Program(cache, "liver", "--paper", "--recordings", str(folder))
    with opened(chromium, program) as page:
        page.get_by_test_id("record").click()
        until(page, lambda s: s["recording"] and s["recording"]["ticks"] > 0)
        assert page.get_by_test_id("recording").is_visible()
        press(page)
        force = settled_force(page)
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0 and s["recording"]["size"] > 0)
        page.get_by_test_id("recording-stop").click()
        until(page, lambda s: s["recording"] is None)
        result = eventually(page, page.get_by_test_id("recorded").inner_text, lambda text: "Recorded" in text)
        (path,) = folder.iterdir()
        assert str(path) in result and f"palpate replay {path}" in result
        page.get_by_label("Dismiss this message").last.click()

        # A folder that is gone stands for any that cannot be written.
        path = path.rename(tmp_path_factory.mktemp("kept") / path.name)
        folder.rmdir()
        page.get_by_test_id("record").click()
        notices = page.locator("#notices")
        assert str(folder) in eventually(page, notices.inner_text, lambda text: str(folder) in text)
        before = state(page)["ticks"]
        until(page, lambda s: s["ticks"] > before and s["recording"] is None)
    assert program.stop() == 0
    return path, force


@pytest.fixture(scope="module")
def replaying(recorded, cache):
    program = Program(cache, str(recorded[0]), command="replay")
    yield program
    assert program.stop() == 0


@pytest.fixture
def replay(chromium, replaying):
    with opened(chromium, replaying, (1280, 760)) as page:
        yield page


def forces_of(recording: palpate.Recording) -> np.ndarray:
    """Of the first tool, (t, 3)."""
    return recording.forces.reshape(len(recording.time), -1, 3)[:, 0]


def pause(page) -> None:
    if state(page)["replay"]["playing"]:
        page.get_by_test_id("timeline-play").click()
    until(page, lambda s: not s["replay"]["playing"])


def scrub(page, tick: int) -> dict:
    """Pull the handle of the line to a tick, and wait until it is made again."""
    place = page.get_by_test_id("timeline-place")
    place.evaluate("(line, tick) => { line.value = tick; line.dispatchEvent(new Event('input')); }", tick)
    return until(page, lambda s: s["replay"]["tick"] == s["replay"]["goal"] == tick)


@pytest.mark.slow
def test_what_the_button_recorded_is_the_session(recorded):
    path, force = recorded
    assert re.fullmatch(r"liver-\d{8}-\d{6}\.mcap", path.name)
    recording = palpate.Recording.load(path)
    assert recording.dropped == 0
    assert palpate.replay(recording).same
    # The page showed the settled force, which the loop held for many ticks.
    assert np.linalg.norm(forces_of(recording) - force, axis=1).min() < 1e-5 * np.linalg.norm(force)
    assert not recording.active[-1].any()


@pytest.mark.slow
def test_the_time_line_shows_the_force_of_each_tick(replay, recorded):
    recording = palpate.Recording.load(recorded[0])
    pause(replay)
    forces = forces_of(recording)
    magnitudes = np.linalg.norm(forces, axis=1)
    strongest = int(magnitudes.argmax())
    # On, back, and on again: going back makes everything again from the first tick.
    for tick in (strongest + 1, strongest // 2 + 1, len(magnitudes)):
        seen = scrub(replay, tick)
        assert seen["force"] == forces[tick - 1].tolist()
        assert seen["contacts"] == np.sum(recording.contacts["tick"] == recording.ticks[tick - 1])
    assert seen["replay"]["restarts"] >= 1
    verdict = replay.get_by_test_id("timeline-verdict").inner_text()
    assert verdict == f"All {len(magnitudes):,} ticks are bit-identical"

    scrub(replay, strongest + 1)
    replay.get_by_test_id("timeline-forward").click()
    seen = until(replay, lambda s: s["replay"]["tick"] == strongest + 2)
    assert seen["force"] == forces[strongest + 1].tolist()
    shown = float(replay.get_by_test_id("force-value").inner_text())
    assert shown == pytest.approx(magnitudes[strongest + 1], abs=0.006)


def test_it_plays_slowly_and_nothing_can_be_pressed(replay):
    pause(replay)
    scrub(replay, 1)
    replay.get_by_role("button", name="1/10x").click()
    until(replay, lambda s: s["replay"]["speed"] == 0.1)
    started = time.monotonic()
    replay.keyboard.press("Space")
    seen = until(replay, lambda s: s["replay"]["tick"] > 20)
    # A tenth of the 1000 ticks a second, and no more than that.
    assert seen["replay"]["tick"] <= 100 * (time.monotonic() - started) + 100
    replay.keyboard.press("Space")
    until(replay, lambda s: not s["replay"]["playing"])

    assert replay.get_by_test_id("replay-note").is_visible()
    assert replay.get_by_test_id("stiffness").is_disabled() and not replay.get_by_test_id("record").is_visible()
    at = state(replay)["replay"]["tick"]
    x, y = replay.evaluate("window.palpate.pickPoint()")
    replay.mouse.move(x, y)
    replay.mouse.down()
    replay.mouse.up()
    scrub(replay, at)
    assert state(replay)["pinned"] == [] and replay.locator("#notices").inner_text() == ""
