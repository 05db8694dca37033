"""The command line ends in order when it is interrupted or terminated."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest

# A program started in the background of a shell ignores interrupts, and so do its children.
HEEDING = (
    "import os, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "os.execv(sys.argv[1], sys.argv[1:])"
)


def awaited(file, process) -> None:
    while not file.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def test_an_interrupt_while_modules_are_imported_is_one_line(tmp_path):
    (tmp_path / "numpy.py").write_text("import time; open('importing', 'w').close(); time.sleep(60)")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    command = [sys.executable, "-c", HEEDING, sys.executable, "-m", "palpate", "--version"]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    awaited(tmp_path / "importing", process)
    process.send_signal(signal.SIGINT)
    _, output = process.communicate(timeout=20)
    assert (process.returncode, output) == (130, "palpate: interrupted\n")


def test_an_interrupt_within_an_import_of_a_command_is_not_swallowed(tmp_path):
    """As by modules that try whether others are there."""
    (tmp_path / "tried.py").write_text("import time; open('importing', 'w').close(); time.sleep(1)")
    (tmp_path / "trying.py").write_text("try:\n    import tried\nexcept BaseException:\n    pass\n")
    program = """
        import sys, time
        from palpate import cli

        @cli.app.app.command()
        def wait():
            import trying
            time.sleep(60)

        sys.argv = ["palpate", "wait"]
        cli.main()
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    command = [sys.executable, "-c", HEEDING, sys.executable, "-c", textwrap.dedent(program)]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    awaited(tmp_path / "importing", process)
    process.send_signal(signal.SIGINT)
    _, output = process.communicate(timeout=20)
    assert (process.returncode, output) == (130, "palpate: interrupted\n")


@pytest.mark.parametrize(("end", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_unfinished_work_is_removed_when_the_command_line_is_ended(tmp_path, end, code):
    program = """
        import sys, time
        from pathlib import Path
        from palpate import cli
        from palpate.atomic import written_beside

        @cli.app.app.command()
        def wait():
            with written_beside(Path("out.txt")) as partial:
                partial.write_text("half")
                time.sleep(60)

        sys.argv = ["palpate", "wait"]
        cli.main()
    """
    command = [sys.executable, "-c", HEEDING, sys.executable, "-c", textwrap.dedent(program)]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not list(tmp_path.iterdir()):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(end)
    _, output = process.communicate(timeout=20)
    assert (process.returncode, output) == (code, "palpate: interrupted\n" if end is signal.SIGINT else "")
    assert not list(tmp_path.iterdir())
