"""Addresses of this machine at which a server can be reached."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import socket

from palpate.errors import ViewerError

# Addresses for documentation (RFC 5737, RFC 3849): nothing is sent, the system only says by which address it would.
ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
# Hosts that stand for every address, and the families they listen on.
EVERY_ADDRESS = {
    "0.0.0.0": (socket.AF_INET,),
    "::": (socket.AF_INET6,),
    "": (socket.AF_INET, socket.AF_INET6),
}
LOOPBACK = {socket.AF_INET: "127.0.0.1", socket.AF_INET6: "::1"}


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
