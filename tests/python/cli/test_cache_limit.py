"""The limit of the cache: least recently used goes first, what is open stays."""

from __future__ import annotations

import os
import time

import pytest
from command_line import refused, run

import palpate
from palpate import cache as cache_limit
from palpate.cache import cache_directory

MEGABYTE = 1_000_000


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, and a way to put a file there that was used so many seconds ago."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = cache_directory()
    folder.mkdir(parents=True)

    def put(name: str, size: float, age: float):
        file = folder / name
        file.write_bytes(b"x" * int(size))
        os.utime(file, (time.time() - age, time.time() - age))
        return file

    return put


def names() -> set[str]:
    return {file.name for file in cache_directory().iterdir()} - {"limit"}


def test_what_was_used_least_recently_goes_first_with_what_belongs_to_it(cache):
    cache("a.palpate", 2 * MEGABYTE, 10)
    cache("b.palpate", 2 * MEGABYTE, 30)
    cache("b.0123456789abcdef.contact.palpate", MEGABYTE, 20)
    cache("c.palpate", 2 * MEGABYTE, 40)
    cache("d.palpate.1.new", MEGABYTE, 50)  # being written: process 1 runs everywhere
    cache_limit.set_cache_limit("6MB")
    assert names() == {"a.palpate", "b.palpate", "b.0123456789abcdef.contact.palpate", "d.palpate.1.new"}
    cache_limit.make_room(needed=2 * MEGABYTE)
    assert names() == {"a.palpate", "d.palpate.1.new"}
    cache_limit.make_room(needed=20 * MEGABYTE, keep=cache_directory() / "a.palpate")
    assert names() == {"a.palpate", "d.palpate.1.new"}


def test_what_a_process_has_open_stays(cache, block):
    body = palpate.Body(block.mesh, material=palpate.Material(7e3, 0.4), fixed=block.fixed_mask)
    green = palpate.precompute(body, progress=False)
    cache("b.palpate", MEGABYTE, 0)
    cache_limit.set_cache_limit(1)
    assert names() == {green.path.name}
    del green
    cache_limit.make_room()
    assert names() == set()


def test_a_precomputation_keeps_the_cache_within_its_limit(cache, block):
    cache("old.palpate", 3 * MEGABYTE, 100)
    cache("new.palpate", MEGABYTE, 1)
    cache_limit.set_cache_limit(4 * MEGABYTE)
    body = palpate.Body(block.mesh, material=palpate.Material(8e3, 0.4), fixed=block.fixed_mask)
    green = palpate.precompute(body, progress=False)
    assert names() == {green.path.name, "new.palpate"}
    # A use counts, not only the writing.
    os.utime(green.path, (0, 0))
    again = palpate.precompute(body, progress=False)
    assert again.path.stat().st_mtime > time.time() - 100


def test_the_limit_is_shown_and_set(cache, tmp_path):
    cache("a.palpate", 2 * MEGABYTE, 10)
    assert run("cache", "limit", cwd=tmp_path).stdout == f"0.002 of {_default()} GB (the default) are used\n"
    assert run("cache", "limit", "20GB", cwd=tmp_path).stdout == "0.002 of 20 GB are used\n"
    assert "2.0 MB of 20 GB in " in run("cache", "list", cwd=tmp_path).stdout
    refused(run("cache", "limit", "much", cwd=tmp_path), "much")
    refused(run("cache", "limit", "0GB", cwd=tmp_path), "must be positive")
    assert "default" in run("cache", "limit", "default", cwd=tmp_path).stdout
    (cache_directory() / "limit").write_text("nothing")
    refused(run("cache", "limit", cwd=tmp_path), "limit: holds no size; set one by 'palpate cache limit 10GB'")
    run("cache", "limit", "1MB", cwd=tmp_path)
    assert names() == set()


def _default() -> str:
    return f"{cache_limit.cache_limit().size / 1e9:.3g}"


def test_run_prints_what_it_keeps(cache, tmp_path):
    result = run("demo", "beam", "--paper", "--headless", "0.1", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    # What the tool needs to know of the body is written when the loop is prepared.
    (store,) = (file for file in cache_directory().iterdir() if "contact" not in file.name)
    size = store.stat().st_size / 1e6
    assert f"kept in the cache: {size:.1f} MB of this scene; " in result.stdout
