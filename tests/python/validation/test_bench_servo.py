"""The envelope of the loop: a tick weighs what its contacts touch and nothing of the rest of the body; runs go on."""

from __future__ import annotations

import json

import numpy as np
import pytest

import palpate
from palpate.validation.bench import servo
from palpate.validation.bench.loop_ticks import KINDS, by_kind, played, running, script

SMALL, LARGE = (14, 14, 3), (24, 24, 3)
SHORT = servo.Settings((SMALL,), (1, 4), ("node",), places=2, plays=2, seconds=0.0)


@pytest.fixture(scope="module")
def plates():
    return {cells: servo.plate(cells) for cells in (SMALL, LARGE)}


def test_a_contact_touches_as_many_nodes_of_a_larger_body(plates):
    sizes = [len(green.surface_nodes) for _, green in plates.values()]
    assert sizes == [servo.surface_nodes(cells) for cells in plates]
    assert sizes[1] > 2 * sizes[0]
    for law in servo.LAWS:
        small, large = (
            servo.touched(servo.simulation_of(body, green, 4, law), servo.middles(body, 4))
            for body, green in plates.values()
        )
        assert small == large
        assert len(small) == 4
        assert all(count == 1 if law == "node" else 10 <= count <= 60 for count in small)


@pytest.mark.parametrize(("contacts", "law"), [(1, "node"), (8, "patch"), (16, "patch"), (16, "local")])
def test_the_loop_makes_as_many_contacts_as_asked_for(plates, contacts, law):
    body, green = plates[SMALL]
    simulation = servo.simulation_of(body, green, contacts, law)
    assert len(servo.touched(simulation, servo.middles(body, contacts))) == contacts


def test_a_tick_costs_the_same_on_a_larger_body_and_more_for_more_contacts(plates):
    """Ratios in one run: the shortest of several plays, by the thread's own clock."""

    def medians(cells, contacts: int) -> dict[str, float]:
        body, green = plates[cells]
        simulation = servo.simulation_of(body, green, contacts, "local")
        path, kinds = script(servo.middles(body, contacts), 6)
        shortest = played(simulation, path, 5).min(axis=0)
        return {kind: times.median for kind, (times, _) in by_kind(shortest[None], kinds).items()}

    small, large, many = medians(SMALL, 1), medians(LARGE, 1), medians(SMALL, 4)
    assert list(small) == list(KINDS)
    for kind in KINDS:
        assert large[kind] < 3 * small[kind]
        assert many[kind] > 3 * small[kind]


def test_a_script_has_every_kind_of_tick(plates):
    body, green = plates[SMALL]
    simulation = servo.simulation_of(body, green, 1, "local")
    path, kinds = script(servo.middles(body, 1), 3)
    forces = np.linalg.norm(simulation.run(path[:, 0]), axis=1)
    touching = np.isin(kinds, [KINDS.index(kind) for kind in ("begin", "held", "sliding", "abrupt")])
    assert (forces[touching] > 0).all()
    assert (forces[~touching] == 0).all()
    assert {KINDS[kind] for kind in kinds if kind >= 0} == set(KINDS)


def test_the_running_loop_is_timed_tick_by_tick(plates):
    body, green = plates[SMALL]
    simulation = servo.simulation_of(body, green, 1, "patch")
    path, _ = script(servo.middles(body, 1), 2)
    times = running(simulation, path, 0.5)
    assert len(times.compute_us) == len(times.wakeup_us)
    assert 400 <= len(times.wakeup_us) + times.missed_waking + times.missed_computing <= 1500
    assert (times.compute_us > 0).all()


def test_an_interrupted_run_goes_on(tmp_path, monkeypatch, plates):
    kept = tmp_path / "servo.json"
    monkeypatch.setattr(servo, "plate", lambda cells: plates[cells])
    measured = servo.measured

    def interrupted(body, green, contacts, law, settings):
        if contacts == 4:
            raise KeyboardInterrupt
        return measured(body, green, contacts, law, settings)

    monkeypatch.setattr(servo, "measured", interrupted)
    with pytest.raises(KeyboardInterrupt):
        servo.run(SHORT, kept)
    (first,) = json.loads(kept.read_text())["rows"]
    monkeypatch.setattr(servo, "measured", lambda *given: measured(*given) if given[2] == 4 else pytest.fail("again"))
    told: list[tuple[int, int]] = []
    results = servo.run(SHORT, kept, lambda *counts: told.append(counts))
    assert told == [(1, 2), (2, 2)]
    made = servo.as_json(results)
    assert made["rows"][0] == first
    assert [row["contacts"] for row in made["rows"]] == [1, 4]
    assert all(list(row["ticks"]) == list(KINDS) for row in made["rows"])
    assert set(made["rows"][0]["ticks"]["held"]) == {"count", "median", "p999", "worst", "costliest"}
    monkeypatch.setattr(servo, "plate", lambda cells: pytest.fail("a plate that nobody needs"))
    assert servo.as_json(servo.run(SHORT, kept)) == made
    servo.plot(results, tmp_path / "servo.png")
    assert (tmp_path / "servo.png").read_bytes().startswith(b"\x89PNG")


def test_a_file_of_something_else_is_refused(tmp_path):
    kept = tmp_path / "servo.json"
    kept.write_text("[]")
    with pytest.raises(palpate.Error, match=r"servo\.json: is not a file of this benchmark"):
        servo.run(SHORT, kept)
    other = {"machine": servo.machine(), "settings": {"places": 1}, "rows": []}
    kept.write_text(json.dumps(other))
    with pytest.raises(palpate.Error, match="other settings or of another machine"):
        servo.run(SHORT, kept)
