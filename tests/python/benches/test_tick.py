"""Times of ticks: one weighs what its contacts touch and nothing of the rest of the body; runs go on."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import pytest

import palpate
from benches import output, tick
from benches.tick_case import Play, Row, _times
from benches.tick_plot import plot_envelope
from palpate.validation.ticks import KINDS, plate, press_centres, script, tick_times, time_loop, times_by_kind

SMALL, LARGE = (14, 14, 3), (24, 24, 3)
SHORT = tick.Settings((SMALL,), (1, 4), ("node",), places=2, plays=2, seconds=0.0)


@pytest.fixture(scope="module")
def plates():
    return {cells: plate(cells) for cells in (SMALL, LARGE)}


def test_a_contact_touches_as_many_nodes_of_a_larger_body(plates):
    sizes = [len(green.surface_nodes) for _, green in plates.values()]
    assert sizes == [tick.surface_nodes(cells) for cells in plates]
    assert sizes[1] > 2 * sizes[0]
    for law in tick.Settings().laws:
        small, large = (
            tick.nodes_under_contacts(tick.envelope_simulation(body, green, 4, law), tick.envelope_centres(body, 4))
            for body, green in plates.values()
        )
        assert small == large
        assert len(small) == 4
        assert all(count == 1 if law == "node" else 10 <= count <= 60 for count in small)


@pytest.mark.parametrize(("contacts", "law"), [(1, "node"), (8, "patch"), (16, "patch"), (16, "local")])
def test_the_loop_makes_as_many_contacts_as_asked_for(plates, contacts, law):
    body, green = plates[SMALL]
    simulation = tick.envelope_simulation(body, green, contacts, law)
    assert len(tick.nodes_under_contacts(simulation, tick.envelope_centres(body, contacts))) == contacts


def test_a_tick_costs_the_same_on_a_larger_body_and_more_for_more_contacts(plates):
    """Ratios in one run: the shortest of several plays, by the thread's own clock."""

    def medians(cells, contacts: int) -> dict[str, float]:
        body, green = plates[cells]
        simulation = tick.envelope_simulation(body, green, contacts, "local")
        path, kinds = script(tick.envelope_centres(body, contacts), 6)
        shortest = tick_times(simulation, path, 5).min(axis=0)
        return {kind: times.median for kind, times in times_by_kind(shortest[None], kinds).items()}

    small, large, many = medians(SMALL, 1), medians(LARGE, 1), medians(SMALL, 4)
    assert list(small) == list(KINDS)
    for kind in KINDS:
        assert large[kind] < 3 * small[kind]
        assert many[kind] > 3 * small[kind]


def test_a_script_has_every_kind_of_tick(plates):
    body, green = plates[SMALL]
    simulation = tick.envelope_simulation(body, green, 1, "local")
    path, kinds = script(tick.envelope_centres(body, 1), 3)
    forces = np.linalg.norm(simulation.run(path[:, 0]), axis=1)
    touching = np.isin(kinds, [KINDS.index(kind) for kind in ("begin", "held", "sliding", "abrupt")])
    assert (forces[touching] > 0).all()
    assert (forces[~touching] == 0).all()
    assert {KINDS[kind] for kind in kinds if kind >= 0} == set(KINDS)


def test_the_running_loop_is_timed_tick_by_tick(plates):
    body, green = plates[SMALL]
    simulation = tick.envelope_simulation(body, green, 1, "patch")
    path, _ = script(tick.envelope_centres(body, 1), 2)
    times = time_loop(simulation, path, 0.5)
    assert len(times.compute_us) == len(times.wakeup_us)
    assert 400 <= len(times.wakeup_us) + times.missed_waking + times.missed_computing <= 1500
    assert (times.compute_us > 0).all()


def test_figures_are_of_all_plays_and_of_shortest_times():
    # Two places of two ticks, played twice; a shortest time of 1, 4, 3 and 2 us.
    row = Row.of("patch", {"tick": "hold"}, np.array([[1.0, 5.0, 3.0, 9.0], [8.0, 4.0, 7.0, 2.0]]), 2, {"gather": 6.0})
    assert (row.median, row.worst) == (4.5, 9.0)
    assert (row.shortest, row.mean, row.costliest) == (2.5, 3.5, 4.0)
    (table,) = tick.as_tables([row])
    assert table.headings == ["tick", "mean", "costliest", "gather"]
    assert table.lines == [["hold", "3.5", "4.0", "6"]]


def test_places_that_are_played_at_once_are_told_apart(monkeypatch, plates):
    body, green = plates[SMALL]
    path = np.arange(12.0).reshape(4, 1, 3)
    order = []

    def numbered(simulation, path, plays, orientation):
        order.append(path[:, 0, 0].tolist())
        return np.arange(float(len(path)))[None]

    monkeypatch.setattr("benches.tick_case.tick_times", numbered)
    loop = tick.envelope_simulation(body, green, 1, "node")
    times = _times(Play(loop, path, ["a", "b"] * 2, plays=3, places=2, at_once=True))
    # Ticks 0 and 1 three times, then 2 and 3.
    assert order == [[0.0, 3.0] * 3 + [6.0, 9.0] * 3]
    assert times.tolist() == [[0.0, 1.0, 6.0, 7.0], [2.0, 3.0, 8.0, 9.0], [4.0, 5.0, 10.0, 11.0]]


@pytest.mark.slow
def test_motions_under_the_local_law_are_in_contact(monkeypatch, plates):
    """One is free, one taps, and large tools begin or end beside what is touchable."""
    monkeypatch.setattr(tick, "_plate", lambda _cells: plates[SMALL])
    monkeypatch.setattr(tick, "contact_us", lambda *_: 1.0)
    monkeypatch.setattr(tick, "solve_us", lambda *_: 1.0)
    monkeypatch.setattr(tick, "TICKS", 400)
    names = list(tick._motions(press_centres(plates[SMALL][0], [(0.0, 0.0)])[0]))
    assert len(names) == 11
    for name in names:
        play = tick.local_play(SMALL, name)
        upright = np.broadcast_to(np.array(play.orientation), (*play.path.shape[:2], 4))
        forces = play.simulation.play(play.path, orientations=upright).forces
        touching = (np.linalg.norm(forces.reshape(len(forces), -1, 3), axis=2) > 0)[-tick.TICKS :]
        low, high = (0.0, 0.0) if name.startswith("free") else (0.5, 0.5) if name.startswith("comes") else (0.7, 1.0)
        assert low <= touching.mean() <= high, name


def test_an_interrupted_run_goes_on(tmp_path, monkeypatch, plates):
    rows_file = tmp_path / "tick.json"
    monkeypatch.setattr(tick, "_plate", lambda cells: plates[cells])
    prepared = tick._envelope_play

    def interrupted(cells, contacts, law, settings):
        if contacts == 4:
            raise KeyboardInterrupt
        return prepared(cells, contacts, law, settings)

    monkeypatch.setattr(tick, "_envelope_play", interrupted)
    with pytest.raises(KeyboardInterrupt):
        tick.run(["envelope"], SHORT, rows_file)
    first = json.loads(rows_file.read_text())["rows"]
    assert [row["labels"]["tick"] for row in first] == list(KINDS)
    monkeypatch.setattr(
        tick, "_envelope_play", lambda *given: prepared(*given) if given[1] == 4 else pytest.fail("again")
    )
    reported: list[tuple[int, int]] = []
    rows = tick.run(["envelope"], SHORT, rows_file, lambda *counts: reported.append(counts))
    assert reported == [(1, 2), (2, 2)]
    assert [asdict(row) for row in rows[: len(KINDS)]] == first
    assert [row.labels["contacts"] for row in rows] == [1] * len(KINDS) + [4] * len(KINDS)
    monkeypatch.setattr(tick, "_plate", lambda cells: pytest.fail("a plate that nobody needs"))
    assert tick.run(["envelope"], SHORT, rows_file) == rows
    plot_envelope(rows, tmp_path / "envelope.png")
    assert (tmp_path / "envelope.png").read_bytes().startswith(b"\x89PNG")


def test_a_file_of_something_else_is_refused(tmp_path):
    rows_file = tmp_path / "tick.json"
    rows_file.write_text("[]")
    with pytest.raises(palpate.Error, match=r"tick\.json: is not a file of this benchmark"):
        tick.run(["envelope"], SHORT, rows_file)
    other = {"machine": output.machine(), "settings": {"places": 1}, "rows": []}
    rows_file.write_text(json.dumps(other))
    with pytest.raises(palpate.Error, match="other settings or of another machine"):
        tick.run(["envelope"], SHORT, rows_file)
