"""The page's files, the checks of requests for them, and the addresses at which a server can be reached."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import socket
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from palpate.errors import ViewerError

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}
# Addresses for documentation (RFC 5737, RFC 3849): nothing is sent, the system only says by which address it would.
ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
# Hosts that stand for every address, and the families they listen on.
EVERY_ADDRESS = {
    "0.0.0.0": (socket.AF_INET,),
    "::": (socket.AF_INET6,),
    "": (socket.AF_INET, socket.AF_INET6),
}
LOOPBACK = {socket.AF_INET: "127.0.0.1", socket.AF_INET6: "::1"}


def load_pages() -> dict[str, tuple[str, bytes]]:
    """Path of each file of the built page, its content type and its bytes; nothing else is ever served.

    Raises ViewerError for a package built without the page.
    """
    root = Path(str(resources.files("palpate.viewer") / "static"))
    files = (file for file in root.rglob("*") if file.suffix in TYPES)
    pages = {f"/{file.relative_to(root).as_posix()}": (TYPES[file.suffix], file.read_bytes()) for file in files}
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

    A page elsewhere may point a name of its own at this machine (DNS rebinding). Only names known to mean this machine
    and the bound address pass. A server bound to every address also answers to addresses, which nobody can rebind.
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


def respond(pages: Mapping[str, tuple[str, bytes]], request: Request, bound: str, port: int) -> Response | None:
    """Serve the page, let the websocket through (None), refuse everything else."""
    host = _single_header(request.headers, "Host")
    if host is None or not is_own_host(host, bound, port):
        return _answer(403, "text/plain", b"wrong Host\n", "")
    path = request.path.partition("?")[0]
    if path == "/socket":
        if _single_header(request.headers, "Origin") != f"http://{host}":
            return _answer(403, "text/plain", b"wrong Origin\n", host)
        return None
    kind, content = pages.get(path, ("text/plain", b"not found\n"))
    return _answer(200 if path in pages else 404, kind, content, host)


def _single_header(headers: Headers, name: str) -> str | None:
    """Value of a header that stands there once; None for none, or for several, of which a proxy may see another."""
    values = headers.get_all(name)
    return values[0] if len(values) == 1 else None


def _answer(status: int, kind: str, content: bytes, host: str) -> Response:
    reasons = {200: "OK", 403: "Forbidden", 404: "Not Found"}
    fields = {**headers(host), "Content-Type": kind, "Content-Length": str(len(content)), "Connection": "close"}
    return Response(status, reasons[status], Headers(fields), content)


def require_free_port(host: str, port: int) -> None:
    """Refuse a port on which something listens, before the work whose page is to be served there; ViewerError."""
    if port == 0:
        return
    with contextlib.suppress(socket.gaierror):
        for family, kind, protocol, _, address in socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM):
            with contextlib.suppress(OSError), socket.socket(family, kind, protocol) as probe:
                # As asyncio does: what a server has just left is free.
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind(address)
                except OSError as error:
                    if error.errno == errno.EADDRINUSE:
                        raise port_in_use(host, port) from None


def port_in_use(host: str, port: int) -> ViewerError:
    """Error for a port on which something listens."""
    return ViewerError(f"port {port} on {host} is in use: choose another with --port, or --port 0 for a free one")


def reachable(host: str) -> list[str]:
    """Hosts to open in a browser for a server that listens on ``host``; what this machine itself opens comes first."""
    families = EVERY_ADDRESS.get(host)
    if families is None:
        return [host]
    found = [LOOPBACK[families[0]]]
    for family in families:
        found += [address for address in _own_addresses(family) if address not in found]
    return found


def _own_addresses(family: socket.AddressFamily) -> list[str]:
    """Addresses that other machines may reach: no loopback, none that need the name of an interface."""
    addresses = []
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((ELSEWHERE[family], 9))
        addresses.append(probe.getsockname()[0])
    with contextlib.suppress(OSError):
        addresses += [str(entry[4][0]) for entry in socket.getaddrinfo(socket.gethostname(), None, family)]
    known = [ipaddress.ip_address(address.partition("%")[0]) for address in dict.fromkeys(addresses)]
    return [str(address) for address in known if not (address.is_loopback or address.is_link_local)]
