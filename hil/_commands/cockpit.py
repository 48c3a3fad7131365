"""`hil cockpit`: a bench in the browser."""

from __future__ import annotations

import secrets
import socket
import stat
import webbrowser
from contextlib import closing
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path
from typing import Final

from fieldbus.errors import ConfigurationError
from hil._commands._moment import bench_at_moment
from hil._commands.terminal import console
from hil._interrupt import note
from hil.bench import BenchFile
from hil.campaign import Token, load_bench_file
from hil.errors import CannotRunError

_NEEDED: Final = ("starlette", "uvicorn", "websockets")
_SHORTEST_TOKEN: Final = 16
_WAITING_BYTES: Final = 64 * 1024
LOOPBACK: Final = "127.0.0.1"


def run_cockpit(
    bench: str,
    *,
    host: str,
    port: int,
    token_file: Path | None,
    allow_motion: bool,
    show: bool,
    seed: int = 0,
    replay: str = "",
    at_s: float | None = None,
) -> int:
    """Serve the cockpit until it is interrupted; returns the exit code.

    Args:
        bench: Bench file or embedded name; empty for the default one.
        host: Address to listen at; empty for the loopback.
        port: Port; 0: any that is free.
        token_file: File with the token; None: a new one for this time.
        allow_motion: Whether axes with a physical drive may be moved.
        show: Whether the browser of this machine opens the page.
        seed: Seed of the bench.
        replay: Token of a case that the first bench is in the middle of; empty: none.
        at_s: Bench time within the case, s; None for its end.

    Raises:
        TokenError: The token is that of a test, or damaged.
        CannotRunError: The extra `cockpit` is not installed, or the port is taken.
        ConfigurationError: A host is given without a token file, or the file cannot be used.

    """
    check_installed()
    from hil.cockpit.assembly import cockpit
    from hil.cockpit.server import http_server

    address = host or LOOPBACK
    if host and not _is_loopback(host) and token_file is None:
        raise ConfigurationError("--host", host, "a loopback address, or any together with --token-file")
    token = secrets.token_urlsafe(24) if token_file is None else _token(token_file)
    of_case = Token.decode(replay) if replay else None
    bench_file = load_bench_file(bench or (of_case.bench if of_case else "") or None)
    if not isinstance(bench_file, BenchFile):
        raise ConfigurationError("bench", bench, "a bench file or an embedded name")
    with closing(listen(address, port)) as listening:
        port = listening.getsockname()[1]
        name = f"[{address}]" if ":" in address else address
        hosts = [f"{one}:{port}" for one in _names(name)]
        app = cockpit(
            bench_file,
            token=token,
            port=port,
            hosts=hosts,
            folder=Path.cwd(),
            allow_motion=allow_motion,
            seed=seed,
            first=None
            if of_case is None
            else lambda: bench_at_moment(of_case, at_s=at_s, reference=bench)[0],
        )
        shown = f"http://{name}:{port}/#token={token}" if token_file is None else f"http://{name}:{port}/"
        console().print(f"cockpit of {bench_file.name}: {shown}", markup=False, soft_wrap=True)
        console().print("Ctrl-C ends it", markup=False)
        if show:
            webbrowser.open(shown)
        try:
            http_server(app).run(sockets=[listening])
        except KeyboardInterrupt:  # given on by the server when it has ended in order
            note()
    return 0


def check_installed() -> None:
    """Refuse what a page in the browser needs and is not installed.

    Raises:
        CannotRunError: The extra `cockpit` is not installed.

    """
    missing = [name for name in _NEEDED if find_spec(name) is None]
    if missing:
        raise CannotRunError(
            f"the cockpit needs {', '.join(missing)}: install it with `pip install 'motion-hil[cockpit]'`"
        )


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _names(name: str) -> list[str]:
    """Return the names under which a page may ask for an address."""
    if name == LOOPBACK:
        return [name, "localhost"]
    if name in {"0.0.0.0", "[::]"}:  # noqa: S104 - said by the user, with a token file
        return [LOOPBACK, "localhost", socket.gethostname(), *_own_addresses()]
    return [name]


def _own_addresses() -> list[str]:
    """Return the addresses of this machine as its name is resolved."""
    try:
        found = socket.getaddrinfo(socket.gethostname(), None, type=socket.SOCK_STREAM)
    except OSError:
        return []
    return [f"[{entry[4][0]}]" if entry[0] is socket.AF_INET6 else str(entry[4][0]) for entry in found]


def _token(file: Path) -> str:
    """Return the token of a file that only its owner may read."""
    token = file.read_text(encoding="utf-8").strip()
    if stat.S_IMODE(file.stat().st_mode) & 0o077:
        raise ConfigurationError(
            "--token-file", str(file), f"a file that only its owner may read: chmod 600 {file}"
        )
    if len(token) < _SHORTEST_TOKEN:
        raise ConfigurationError(
            "--token-file", str(file), f"a token of {_SHORTEST_TOKEN} characters or more"
        )
    return token


def listen(address: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises:
        CannotRunError: The port is taken.

    """
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    # What waits in the system for a slow page is old when it comes: connections inherit this bound.
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _WAITING_BYTES)
    try:
        listening.bind((address, port))
        listening.listen()  # who reads the address may come at once
    except OSError as error:
        listening.close()
        raise CannotRunError(f"port {port} of {address}: {error.strerror}; another one with --port") from None
    return listening
