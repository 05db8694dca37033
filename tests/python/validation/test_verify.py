"""The accuracy table of `palpate verify`: each figure within its tolerance."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from palpate.cli import main
from palpate.validation.verify import BENCHMARKS, Benchmark, Check, Outcome
from palpate.validation.verify.contact import energy

# A map of direct solutions takes minutes; tests/python/palpation has one point of it.
ALONE = {"palpation"}
ALL = [
    pytest.param(b, id=b.name, marks=[pytest.mark.slow] if b.slow else [])
    for b in BENCHMARKS.values()
    if b.name not in ALONE
]


def run_cli(monkeypatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["palpate", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    return stop.value.code or 0


@pytest.mark.parametrize("benchmark", ALL)
def test_figures_are_within_their_tolerance(benchmark, monkeypatch, tmp_path, rounds):
    monkeypatch.setattr(energy, "PATHS", rounds(2400))  # the command tries ten thousand
    outcome = benchmark.run()
    missed = [f"{c.quantity}: {c.computed:g}, target {c.target:g}" for c in outcome.checks if not c.passed]
    assert not missed
    assert any(c.tolerance is not None for c in outcome.checks)
    for name, draw in outcome.plots.items():
        draw(tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_the_command_prints_figures_with_their_verdict(monkeypatch, capsys):
    assert run_cli(monkeypatch, "verify", "rigid", "le10") == 0
    text = capsys.readouterr().out
    assert "NAFEMS LE10" in text
    assert "-5.38 MPa" in text
    assert "none beyond tolerance" in text
    assert run_cli(monkeypatch, "verify", "le10", "--json") == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["benchmark"], row["verdict"], row["tolerance"]) == ("le10", "pass", 0.02)


def test_a_figure_beyond_its_tolerance_fails_the_command(monkeypatch, capsys):
    def off() -> Outcome:
        return Outcome([Check("length", 1.03, 1.0, "a ruler", 0.02, "m"), Check("shown", 5.0, 1.0, "a ruler", None)])

    monkeypatch.setitem(BENCHMARKS, "off", Benchmark("off", "A wrong length", off))
    assert run_cli(monkeypatch, "verify", "off") == 1
    text = capsys.readouterr().out
    assert "FAIL" in text
    assert "1 figures, 1 beyond tolerance" in text


def test_an_unknown_benchmark_is_refused_with_the_known_ones(monkeypatch, capsys):
    assert run_cli(monkeypatch, "verify", "nope") == 2
    assert "no benchmark is called 'nope'; there are patch, rigid" in capsys.readouterr().err


@pytest.mark.slow
def test_plots_of_what_was_run(monkeypatch, tmp_path):
    assert run_cli(monkeypatch, "verify", "convergence", "--out", str(tmp_path / "plots")) == 0
    assert [p.name for p in Path(tmp_path / "plots").iterdir()] == ["convergence.png"]
