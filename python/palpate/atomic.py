"""Files and folders appear whole or not at all: written beside, then renamed.

Files are written as ``<name>.<process>.new`` (stores), ``<name>.<process>.partial`` (what stands beside them) or
``.<process>.<name>`` (everything else) and renamed when they are complete. A process that is killed leaves them, in
full size; the next writer there removes them. Processes are those of this machine: what one in another container
writes into the same folder looks like a leftover.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

from palpate import _native
from palpate.errors import Error

_NAMES = (re.compile(r"(?P<name>.+)\.(?P<process>\d+)\.(new|partial)"), re.compile(r"\.(?P<process>\d+)\.(?P<name>.+)"))


@contextlib.contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name a file in errors of the system that do not: a full disk is found by its file."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = os.fspath(path)
        raise


def destination(path: Path, error: type[Error] = Error) -> Path:
    """File that is written for ``path``: the one that a symbolic link names, so that the link stays.

    Raises ``error`` for what is no regular file, and must not be replaced by one, and for links in a circle.
    """
    try:
        target = path.resolve() if path.is_symlink() else path
        mode = target.stat().st_mode
    except FileNotFoundError:
        return target
    except (RuntimeError, OSError) as failure:
        reason = failure.strerror if isinstance(failure, OSError) and failure.strerror else "a circle of symbolic links"
        raise error(f"{path}: {reason}") from None
    if not stat.S_ISREG(mode):
        raise error(f"{path} is {_kind(mode)}, no file that can be replaced: give another name")
    return target


def _kind(mode: int) -> str:
    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    return kinds.get(stat.S_IFMT(mode), "a device")


@contextlib.contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Give a path to write to, which becomes ``path`` when the block ends well, and is deleted otherwise.

    Raises Error for a place that is no regular file. An OSError from within the block is given the name ``path`` (a
    full disk names nothing).
    """
    target = destination(path)
    remove_leftovers(target)
    partial = target.with_name(f".{os.getpid()}.{target.name}")
    try:
        yield partial
        os.replace(partial, target)
    except OSError as error:
        error.filename = os.fspath(path)
        raise
    finally:
        partial.unlink(missing_ok=True)


@contextlib.contextmanager
def folder_beside(path: Path) -> Iterator[Path]:
    """Give an empty folder to fill, which takes the place of ``path`` when the block ends well, and else is deleted.

    At every moment the old folder or the new one is there: they are exchanged in one step where the system can do that.
    Elsewhere an interruption between two renames leaves the old one, and the next call puts it back if the program was
    killed.
    """
    target = path.resolve() if path.is_symlink() else path
    before = target.with_name(f".{os.getpid()}.{target.name}.before")
    _put_back(target)
    remove_leftovers(target)
    partial = target.with_name(f".{os.getpid()}.{target.name}")
    partial.mkdir()
    try:
        yield partial
        if not target.exists():
            os.replace(partial, target)
        elif not _native.exchange(partial, target):
            # A folder that is not empty cannot be replaced in one step.
            os.replace(target, before)
            os.replace(partial, target)
    except OSError as error:
        error.filename = os.fspath(path)
        raise
    finally:
        if before.exists() and not target.exists():
            os.replace(before, target)
        shutil.rmtree(partial, ignore_errors=True)
        shutil.rmtree(before, ignore_errors=True)


def _put_back(target: Path) -> None:
    """Put back a folder that a killed process had moved out of the way of the new one, or remove it."""
    if not target.parent.is_dir():
        return
    for before in target.parent.iterdir():
        if is_leftover(before, f"{target.name}.before"):
            if target.exists():
                shutil.rmtree(before, ignore_errors=True)
            else:
                os.replace(before, target)


def remove_leftovers(path: Path) -> None:
    """Remove what killed processes left of a file that is about to be written."""
    if not path.parent.is_dir():
        return
    for file in path.parent.iterdir():
        if is_leftover(file, path.name):
            if file.is_dir():
                shutil.rmtree(file, ignore_errors=True)
                continue
            with contextlib.suppress(OSError):
                file.unlink()


def is_leftover(file: Path, name: str | None = None) -> bool:
    """Whether a process that is gone was writing this file; of a file ``name`` alone if it is given."""
    match = next(filter(None, (pattern.fullmatch(file.name) for pattern in _NAMES)), None)
    if match is None or name not in (None, match["name"]):
        return False
    return not _runs(int(match["process"]))


def _runs(process: int) -> bool:
    if sys.platform == "win32":
        return _runs_on_windows(process)
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        # A process of another user, or a number that no process has: such a file is not this program's.
        return True
    return True


def _runs_on_windows(process: int) -> bool:
    """Ask for the exit code: ``os.kill`` would end the process there, or the program that asks."""
    import ctypes

    limited_information, still_active, refused = 0x1000, 259, 5
    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    kernel.OpenProcess.restype = ctypes.c_void_p
    handle = kernel.OpenProcess(limited_information, False, process)
    if not handle:
        return ctypes.get_last_error() == refused
    code = ctypes.c_ulong()
    known = kernel.GetExitCodeProcess(ctypes.c_void_p(handle), ctypes.byref(code))
    kernel.CloseHandle(ctypes.c_void_p(handle))
    return not known or code.value == still_active
