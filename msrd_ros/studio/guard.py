"""Who may come in: no page but ours may drive the arm, and nobody from elsewhere without a token."""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass

LOOPBACK = "127.0.0.1"
TOKEN = "token"
_OWN_NAMES = (LOOPBACK, "localhost", "[::1]")


@dataclass(frozen=True)
class Guard:
    """Holds requests against where the page is served.

    A web page of anybody's may send requests to this machine. Browsers then say whose page it was (Origin),
    and which name it was reached by (Host), which a name that has been made to point here gives away.

    Attributes
    ----------
    port
        Where the page is served.
    token
        What who comes must know; empty where only this machine can come.
    """

    port: int
    token: str = ""

    def refusal(self, headers: Mapping[str, str], shown_token: str, drives: bool) -> str:
        """Why a request is refused; empty if it is not.

        Parameters
        ----------
        headers
            Of the request.
        shown_token
            What it says as the token.
        drives
            Whether it opens a way to drive the arm, for which browsers always say an origin.
        """
        host = headers.get("Host", "")
        if not self.token and host not in {f"{name}:{self.port}" for name in _OWN_NAMES}:
            return f"host {host!r} is not this studio; open http://{LOOPBACK}:{self.port}"
        origin = headers.get("Origin")
        if origin is None and drives:
            return "no origin is said; open the page in a browser"
        if origin is not None and origin != f"http://{host}":
            return f"a page of {origin} may not use this studio"
        if self.token and not hmac.compare_digest(shown_token.encode(), self.token.encode()):
            return "the token is missing or wrong; open the address that the studio printed"
        return ""
