"""The page's files, and the checks of requests for them."""

from __future__ import annotations

import ipaddress
import socket
from importlib import resources

from palpate.errors import ViewerError

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


def load_pages() -> dict[str, tuple[str, bytes]]:
    """Path of each file of the built page, its content type and its bytes; nothing else is ever served.

    Raises
    ------
    ViewerError
        A package built without the page.

    """
    root = resources.files("palpate.viewer") / "static"
    pages: dict[str, tuple[str, bytes]] = {}
    folders = [("", root)] if root.is_dir() else []
    while folders:
        prefix, folder = folders.pop()
        for entry in folder.iterdir():
            path = f"{prefix}/{entry.name}"
            if entry.is_dir():
                folders.append((path, entry))
            elif (kind := TYPES.get("." + entry.name.rpartition(".")[2])) is not None:
                pages[path] = (kind, entry.read_bytes())
    if "/index.html" not in pages:
        raise ViewerError("the viewer's page is not built: run 'make viewer' (it needs Node), or use --headless")
    pages["/"] = pages["/index.html"]
    return pages


def headers(host: str) -> dict[str, str]:
    """Headers of every answer: the page runs its own script only, and talks to its own server only."""
    policy = (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; "
        f"connect-src 'self' ws://{host}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    )
    return {
        "Content-Security-Policy": policy,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }


def is_own_host(header: str | None, bound: str, port: int) -> bool:
    """Whether a Host header names this server.

    A page elsewhere may point a name of its own at this machine (DNS rebinding): only names known to mean this machine
    and the bound address pass; a server bound to every address also answers to addresses, which nobody can rebind.
    """
    if header is None:
        return False
    name, _, given_port = header.rpartition(":")
    if not name or "]" in given_port:
        name, given_port = header, "80"
    if given_port != str(port):
        return False
    name = name.strip("[]").lower()
    if name in {"127.0.0.1", "localhost", "::1", bound.lower()}:
        return True
    if bound not in {"0.0.0.0", "::", ""}:
        return False
    return _is_address(name) or name == socket.gethostname().lower()


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
