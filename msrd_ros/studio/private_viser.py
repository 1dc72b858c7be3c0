"""A viser server that answers the studio alone."""

from __future__ import annotations

import contextlib
import hmac
import io
import secrets
from collections.abc import Iterator
from typing import Any

import viser
import websockets.asyncio.server

from msrd_ros.studio.guard import LOOPBACK

SECRET_HEADER = "X-Studio-Secret"


class PrivateViser:
    """Starts viser on a port of the system's choice, and lets in who knows a secret made for it.

    viser has neither token nor origin check, so that any page open in a browser on this machine could drive
    what is in the scene. The studio's own server stands before it and adds the secret.

    Attributes
    ----------
    server
        The viser server.
    secret
        What a request must have in the header `SECRET_HEADER`.
    """

    def __init__(self) -> None:
        self.secret = secrets.token_urlsafe(32)
        with _answering_only(self.secret), contextlib.redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(host=LOOPBACK, port=0, verbose=False)

    @property
    def address(self) -> str:
        """Host and port where it listens."""
        return f"{LOOPBACK}:{self.server.get_port()}"

    def close(self) -> None:
        """Listen no more."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()


@contextlib.contextmanager
def _answering_only(secret: str) -> Iterator[None]:
    """Have the server that viser starts meanwhile refuse whoever does not say the secret.

    viser offers no hook for this; its constructor returns once its server listens.
    """
    module = websockets.asyncio.server
    serve = module.serve

    def guarded(handler: Any, host: str, port: int, *, process_request: Any, **options: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            if not hmac.compare_digest(request.headers.get(SECRET_HEADER, "").encode(), secret.encode()):
                return connection.respond(403, "only the studio may come in here\n")
            return process_request(connection, request)

        return serve(handler, host, port, process_request=process, **options)

    module.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        module.serve = serve  # type: ignore[misc]
