"""Options of 'palpate run' for OpenIGTLink."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from palpate.viewer.server import ViewerServer


@dataclass(frozen=True)
class LinkOptions:
    """What was asked for of OpenIGTLink."""

    igtl: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Port of OpenIGTLink, such as 18944, for 3D Slicer and trackers; default: closed."
        ),
    ] = None
    igtl_host: Annotated[
        str, typer.Option(help="Address of OpenIGTLink; others than 127.0.0.1 let other machines move the tool.")
    ] = "127.0.0.1"
    igtl_axes: Annotated[
        Literal["RAS", "LPS"], typer.Option(help="Axes of OpenIGTLink's messages, in millimetres.")
    ] = "RAS"
    igtl_from: Annotated[
        str | None,
        typer.Option(help="HOST:PORT of an OpenIGTLink server that sends poses, such as PLUS, to be called."),
    ] = None

    @property
    def is_asked(self) -> bool:
        """Whether anything is to be served or called."""
        return self.igtl is not None or self.igtl_from is not None


@contextlib.contextmanager
def linked(server: ViewerServer, options: LinkOptions, folder: Path) -> Iterator[None]:
    """Serve OpenIGTLink for the scene that a page's server runs; ViewerError for a port in use."""
    if not options.is_asked:
        yield
        return
    from palpate.openigtlink import Axes, Link, LinkServer

    link = Link(lambda: getattr(server.session, "simulation", None), Axes(options.igtl_axes), folder)
    tracker = None if options.igtl_from is None else _address(options.igtl_from)
    with LinkServer(link, options.igtl, host=options.igtl_host, tracker=tracker) as served:
        if served.port is not None:
            print(f"OpenIGTLink is at {options.igtl_host}:{served.port}, in mm and {options.igtl_axes}", flush=True)
        yield


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise typer.BadParameter(f"--igtl-from takes HOST:PORT, got '{text}'")
    return host, int(port)
