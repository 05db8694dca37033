"""Commands on the cache of precomputed files."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

import typer

from palpate.cache import cache_directory, cache_limit, cached_files, chosen_files, set_cache_limit
from palpate.cli.app import app

cache_app = typer.Typer(help="Precomputed files kept for you.", no_args_is_help=True)
app.add_typer(cache_app, name="cache")


def _names(incomplete: str) -> list[str]:
    return [file.name for file in cached_files() if file.name.startswith(incomplete)]


@cache_app.command("list")
def cache_list() -> None:
    """List the precomputed files in the cache: name, size, when they were last used, and what they are.

    Example: palpate cache list
    """
    files = cached_files()
    width = max((len(file.name) for file in files), default=0)
    for file in files:
        date = datetime.fromtimestamp(file.used).strftime("%Y-%m-%d %H:%M")
        print(f"{file.name:{width}}  {file.size / 1e6:9.1f} MB  {date}  {file.about}")
    left = sum(file.leftover for file in files)
    hint = f", {left} of them leftovers: 'palpate cache clear --leftovers' deletes those" if left else ""
    size, limit = sum(f.size for f in files) / 1e6, cache_limit().size / 1e9
    print(f"{_count_text(len(files))}, {size:.1f} MB of {limit:.3g} GB in {cache_directory()}{hint}")


@cache_app.command("limit")
def cache_limit_command(
    size: Annotated[
        str | None,
        typer.Argument(help="Such as 20GB, or 'default'. Without it the command prints the limit and the use."),
    ] = None,
) -> None:
    """Show or set how large the cache may become: what was used least recently is deleted first.

    By default 10 GB, or a tenth of the disk where that is less. What a program has open stays.

    Example: palpate cache limit 20GB
    """
    if size is not None:
        set_cache_limit(None if size == "default" else size)
    used, limit = sum(file.size for file in cached_files()) / 1e9, cache_limit()
    print(f"{used:.3g} of {limit.size / 1e9:.3g} GB{'' if limit.is_set else ' (the default)'} are used")


@cache_app.command("clear")
def cache_clear(
    name: Annotated[
        str | None,
        typer.Argument(help="Name of a file, or its beginning; all files without it.", autocompletion=_names),
    ] = None,
    leftovers: Annotated[
        bool, typer.Option("--leftovers", help="Only files that killed processes left behind.")
    ] = False,
) -> None:
    """Delete the precomputed files in the cache, or one of them.

    Example: palpate cache clear 3f2a90
    """
    files = cached_files() if name is None else chosen_files(name)
    files = [file for file in files if file.leftover or not leftovers]
    for file in files:
        file.path.unlink(missing_ok=True)
    print(f"deleted {_count_text(len(files))}, {sum(f.size for f in files) / 1e6:.1f} MB")


def _count_text(count: int) -> str:
    return f"{count} file" if count == 1 else f"{count} files"
