"""Progress of long work reaches all who watch."""

from __future__ import annotations

from palpate.progress import Reporter, reported_to


def test_what_is_done_is_passed_on_to_all_reporters():
    heard: list[list[object]] = [[], []]

    def reporter(rank: int) -> Reporter:
        return Reporter(lambda done, total: heard[rank].append((done, total)), heard[rank].append)

    both = reported_to(reporter(0), None, reporter(1))
    both.phase("columns")
    both(3, 7)
    assert heard == [["columns", (3, 7)], ["columns", (3, 7)]]
