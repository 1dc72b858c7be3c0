"""The one server that browsers reach: the page, its live connection, and the way to the scene behind it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import aiohttp
from aiohttp import web

from msrd_ros.core.errors import UserError
from msrd_ros.studio.guard import LOOPBACK, TOKEN, Guard
from msrd_ros.studio.private_viser import SECRET_HEADER, PrivateViser

Ask = Callable[["Browser", dict[str, Any]], None]
"""Takes what a browser asks for, on a thread of the server's own."""

MOST_BYTES = 1 << 16
"""Of one message from a browser."""
HEARTBEAT_S = 15.0
"""A browser that is busy drawing answers late; who guides by hand is missed much sooner."""
MOST_ANSWERS = 1000
"""A browser that reads so few of its answers is let go."""
_FIRST_OF_HEAD = b'<head><script src="/software.js"></script>'
"""Of the scene's page: runs before all else."""
_HOP_HEADERS = {
    "connection",
    "upgrade",
    "keep-alive",
    "transfer-encoding",
    "content-encoding",
    "content-length",
}
_SAFETY = {
    # No page of others' may show ours in a frame and have its buttons pressed.
    "Content-Security-Policy": "frame-ancestors 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


class Browser:
    """One page that is open somewhere.

    Of what is shown only the newest counts: a browser that is slow leaves pictures out and stays with the
    present. Answers are all sent.
    """

    def __init__(self, number: int, loop: asyncio.AbstractEventLoop) -> None:
        self.number = number
        self._loop = loop
        self._due = asyncio.Event()
        self._answers: list[str] = []
        self._state = ""

    def answer(self, content: dict[str, Any]) -> None:
        """Send an answer; from any thread."""
        text = json.dumps(content)
        self._from_loop(lambda: self._answers.append(text))

    def show(self, text: str) -> None:
        """Send a state in place of one that has not been sent yet; on the server's thread."""
        self._state = text
        self._due.set()

    def _from_loop(self, work: Callable[[], None]) -> None:
        def run() -> None:
            work()
            self._due.set()

        with contextlib.suppress(RuntimeError):  # the server has just ended
            self._loop.call_soon_threadsafe(run)

    async def send_all(self, socket: web.WebSocketResponse) -> None:
        """Send what comes, until the browser is gone."""
        while len(self._answers) < MOST_ANSWERS:
            await self._due.wait()
            self._due.clear()
            texts, self._answers, self._state = [*self._answers, self._state], [], ""
            for text in filter(None, texts):
                await socket.send_str(text)
        await socket.close()


class Gateway:
    """Serves the page on a thread of its own.

    Parameters
    ----------
    guard
        Decides who comes in.
    host
        Address to listen at.
    scene
        What stands behind ``/scene/``.
    ask
        Called with what a browser asks for.
    left
        Called when a browser is gone.

    Raises
    ------
    UserError
        If the port is taken; says what to do.
    """

    def __init__(
        self, guard: Guard, host: str, scene: PrivateViser, ask: Ask, left: Callable[[Browser], None]
    ) -> None:
        self._guard, self._scene, self._ask, self._left = guard, scene, ask, left
        self._browsers: dict[int, Browser] = {}
        self._came = 0
        self._loop = asyncio.new_event_loop()
        self._runner: web.AppRunner | None = None
        self._session: aiohttp.ClientSession | None = None
        try:
            self._loop.run_until_complete(self._start(host))
        except OSError as error:
            self._loop.run_until_complete(self._stop())
            raise UserError(
                f"port {guard.port} of {host} cannot be had ({error.strerror}); end what has it, "
                "or give another: port:=8081"
            ) from None
        self._thread = threading.Thread(target=self._loop.run_forever, name="studio", daemon=True)
        self._thread.start()

    @property
    def browsers(self) -> int:
        """How many are here."""
        return len(self._browsers)

    def show(self, state: dict[str, Any]) -> None:
        """Send a state to all browsers; from any thread."""
        if self._browsers:
            text = json.dumps({"type": "state", **state})
            self._loop.call_soon_threadsafe(self._show, text)

    def close(self) -> None:
        """Serve no more."""
        asyncio.run_coroutine_threadsafe(self._stop(), self._loop).result(5.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _show(self, text: str) -> None:
        for browser in self._browsers.values():
            browser.show(text)

    async def _start(self, host: str) -> None:
        application = web.Application(middlewares=[self._hold])
        application.router.add_get("/", self._page)
        application.router.add_get("/live", self._live)
        application.router.add_get(r"/{name:[a-z]+\.(css|js)}", self._page)
        application.router.add_get("/scene{slash:/?}{path:.*}", self._behind)
        self._session = aiohttp.ClientSession(
            headers={SECRET_HEADER: self._scene.secret}, auto_decompress=False
        )
        self._runner = web.AppRunner(application, access_log=None, shutdown_timeout=1.0)
        await self._runner.setup()
        await web.TCPSite(self._runner, host, self._guard.port).start()

    async def _stop(self) -> None:
        if self._runner is not None:
            await self._runner.cleanup()
        if self._session is not None:
            await self._session.close()

    # -- who comes in --------------------------------------------------------------------------

    @web.middleware
    async def _hold(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Hold every request against the guard before anything else."""
        shown = request.query.get(TOKEN, "") or request.cookies.get(TOKEN, "")
        drives = request.headers.get("Upgrade", "").lower() == "websocket"
        refusal = self._guard.refusal(request.headers, shown, drives)
        if refusal:
            return web.Response(status=403, text=f"{refusal}\n", headers=_SAFETY)
        if self._guard.token and TOKEN in request.query:
            # Out of the address, which is kept in histories.
            moved = web.Response(status=302, headers={"Location": "/", **_SAFETY})
            moved.set_cookie(TOKEN, shown, httponly=True, samesite="Strict")
            return moved
        response: web.StreamResponse = await handler(request)
        return response

    # -- what is served ------------------------------------------------------------------------

    async def _page(self, request: web.Request) -> web.Response:
        name = request.match_info.get("name", "index.html")
        file = files("msrd_ros.studio").joinpath("page", name)
        if not file.is_file():
            raise web.HTTPNotFound(headers=_SAFETY)
        text = file.read_text(encoding="utf-8")
        types = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
        kind = types[name.rpartition(".")[2]]
        return web.Response(text=text, content_type=kind, headers=_SAFETY)

    async def _live(self, request: web.Request) -> web.WebSocketResponse:
        """The connection over which a page is told what happens, and says what is to be done."""
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MOST_BYTES)
        await socket.prepare(request)
        self._came += 1
        browser = self._browsers[self._came] = Browser(self._came, self._loop)
        browser.answer({"type": "hello", "browser": browser.number})
        sending = asyncio.create_task(browser.send_all(socket))
        try:
            async for message in socket:
                self._take(browser, message)
        finally:
            sending.cancel()
            del self._browsers[browser.number]
            self._left(browser)
        return socket

    def _take(self, browser: Browser, message: aiohttp.WSMessage) -> None:
        try:
            content = json.loads(message.data)
        except (TypeError, ValueError):
            content = None
        if isinstance(content, dict):
            self._ask(browser, content)
        else:
            browser.answer({"type": "answer", "ok": False, "text": "not understood: send a JSON object"})

    async def _behind(self, request: web.Request) -> web.StreamResponse:
        """Pass on to the scene's own server."""
        assert self._session is not None
        path = request.match_info["path"]
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return await self._between(request)
        url = f"http://{self._scene.address}/{path}"
        encodings = {"Accept-Encoding": request.headers.get("Accept-Encoding", "") if path else "identity"}
        async with self._session.get(url, headers=encodings) as inner:
            body = await inner.read()
            if not path:
                body = body.replace(b"<head>", _FIRST_OF_HEAD, 1)
            kept = {name: value for name, value in inner.headers.items() if name.lower() not in _HOP_HEADERS}
            coding = inner.headers.get("Content-Encoding")
            if coding and coding != "identity":
                kept["Content-Encoding"] = coding
            return web.Response(status=inner.status, body=body, headers={**kept, **_SAFETY})

    async def _between(self, request: web.Request) -> web.StreamResponse:
        """Hand messages on between a browser and the scene, in both directions."""
        assert self._session is not None
        wanted = [
            word.strip() for word in request.headers.get("Sec-WebSocket-Protocol", "").split(",") if word
        ]
        outer = web.WebSocketResponse(protocols=wanted, max_msg_size=0, compress=False)
        await outer.prepare(request)
        async with self._session.ws_connect(
            f"ws://{self._scene.address}/", protocols=wanted, max_msg_size=0
        ) as inner:
            await asyncio.wait(
                [asyncio.create_task(_pump(outer, inner)), asyncio.create_task(_pump(inner, outer))],
                return_when=asyncio.FIRST_COMPLETED,
            )
        await outer.close()
        return outer


async def _pump(source: Any, target: Any) -> None:
    async for message in source:
        if message.type is aiohttp.WSMsgType.BINARY:
            await target.send_bytes(message.data)
        elif message.type is aiohttp.WSMsgType.TEXT:
            await target.send_str(message.data)


def address(host: str, guard: Guard) -> str:
    """What to open in a browser."""
    shown = LOOPBACK if host in ("0.0.0.0", LOOPBACK) else host
    return f"http://{shown}:{guard.port}" + (f"/?{TOKEN}={guard.token}" if guard.token else "")
