"""The server that browsers reach: who it lets in, and that there is no way round it."""

from __future__ import annotations

import asyncio
import json
import urllib.error
import urllib.request
from collections.abc import Coroutine, Iterator
from typing import Any

import aiohttp
import pytest
from viser import __version__ as viser_version

from msrd_ros.core.errors import UserError
from msrd_ros.studio.gateway import Browser, Gateway, address
from msrd_ros.studio.guard import LOOPBACK, Guard
from msrd_ros.studio.private_viser import PrivateViser
from studio_stack import free_port

WAIT_S = 10.0
CLIENT = f"viser-v{viser_version}"
"""Subprotocol of the scene's own client."""


class Served:
    """A gateway, and what was asked of it."""

    def __init__(self, viser: PrivateViser, token: str = "") -> None:
        self.guard = Guard(free_port(), token)
        self.asked: list[dict[str, Any]] = []
        self.left: list[int] = []
        self.gateway = Gateway(
            self.guard, LOOPBACK, viser, self._ask, lambda one: self.left.append(one.number)
        )
        self.url = f"http://{LOOPBACK}:{self.guard.port}"

    def _ask(self, browser: Browser, content: dict[str, Any]) -> None:
        self.asked.append(content)
        browser.answer({"type": "answer", "id": content.get("id"), "ok": True, "text": "done"})


@pytest.fixture(scope="module")
def viser() -> Iterator[PrivateViser]:
    one = PrivateViser()
    yield one
    one.close()


@pytest.fixture
def served(viser: PrivateViser) -> Iterator[Served]:
    one = Served(viser)
    yield one
    one.gateway.close()


def run(work: Coroutine[Any, Any, Any]) -> Any:
    return asyncio.run(asyncio.wait_for(work, WAIT_S))


def status(url: str, **headers: str) -> int:
    request = urllib.request.Request(
        url, headers={name.replace("_", "-"): text for name, text in headers.items()}
    )
    try:
        with urllib.request.urlopen(request, timeout=WAIT_S) as response:
            return int(response.status)
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.parametrize("path", ["/", "/studio.js", "/learn.js", "/studio.css", "/scene/"])
def test_our_page_is_served_and_nobody_frames_it(served: Served, path: str) -> None:
    with urllib.request.urlopen(served.url + path, timeout=WAIT_S) as response:
        assert response.headers["Content-Security-Policy"] == "frame-ancestors 'self'"
        assert response.read()


@pytest.mark.parametrize("path", ["/other.js", "/studio.py", "/../guard.py", "/page/studio.js"])
def test_nothing_else_is_served(served: Served, path: str) -> None:
    assert status(served.url + path) == 404


@pytest.mark.parametrize("path", ["/", "/live", "/scene/"])
def test_pages_of_others_get_nothing(served: Served, path: str) -> None:
    assert status(served.url + path, Origin="http://evil.example") == 403
    assert status(served.url + path, Host="evil.example") == 403


@pytest.mark.parametrize("path", ["/live", "/scene/"])
@pytest.mark.parametrize("origin", [None, "http://evil.example", "null"])
def test_no_websocket_without_our_own_origin(served: Served, path: str, origin: str | None) -> None:
    async def work() -> int:
        async with aiohttp.ClientSession() as session:
            try:
                await session.ws_connect(served.url + path, origin=origin)
            except aiohttp.WSServerHandshakeError as error:
                return error.status
        return 101

    assert run(work()) == 403
    assert served.asked == []


def test_there_is_no_way_round_to_the_scene(viser: PrivateViser) -> None:
    assert status(f"http://{viser.address}/") == 403
    assert status(f"http://{viser.address}/", X_Studio_Secret="guessed") == 403

    async def work() -> int:
        async with aiohttp.ClientSession() as session:
            try:
                await session.ws_connect(f"http://{viser.address}/", protocols=[CLIENT])
            except aiohttp.WSServerHandshakeError as error:
                return error.status
        return 101

    assert run(work()) == 403


def test_what_is_asked_arrives_and_is_answered(served: Served) -> None:
    async def work() -> list[dict[str, Any]]:
        async with aiohttp.ClientSession() as session:
            async with session.ws_connect(f"{served.url}/live", origin=served.url) as live:
                hello = json.loads((await live.receive()).data)
                assert hello == {"type": "hello", "browser": 1}
                await live.send_str(json.dumps({"do": "stop", "id": 7}))
                found = [json.loads((await live.receive()).data)]
                await live.send_str("no JSON")
                found.append(json.loads((await live.receive()).data))
                served.gateway.show({"time_s": 1.0})
                return [*found, json.loads((await live.receive()).data)]

    answer, refusal, state = run(work())
    assert answer == {"type": "answer", "id": 7, "ok": True, "text": "done"}
    assert served.asked == [{"do": "stop", "id": 7}]
    assert not refusal["ok"]
    assert "JSON" in refusal["text"]
    assert state == {"type": "state", "time_s": 1.0}


def test_a_browser_that_leaves_is_noticed(served: Served) -> None:
    async def work() -> None:
        async with aiohttp.ClientSession() as session:
            async with session.ws_connect(f"{served.url}/live", origin=served.url):
                while not served.gateway.browsers:
                    await asyncio.sleep(0.02)
        while not served.left:
            await asyncio.sleep(0.02)

    run(work())
    assert served.gateway.browsers == 0


def test_the_scene_passes_through(served: Served) -> None:
    async def work() -> Any:
        async with aiohttp.ClientSession() as session:
            async with session.ws_connect(
                f"{served.url}/scene/", origin=served.url, protocols=[CLIENT]
            ) as scene:
                return (await scene.receive()).type

    assert run(work()) is aiohttp.WSMsgType.BINARY


def test_a_taken_port_is_an_error_that_says_so(served: Served, viser: PrivateViser) -> None:
    with pytest.raises(UserError, match=f"port {served.guard.port} .* give another: port:="):
        Gateway(served.guard, LOOPBACK, viser, lambda *_: None, lambda _: None)


def test_exposed_the_token_opens_and_leaves_the_address(viser: PrivateViser) -> None:
    one = Served(viser, token="a-secret")
    try:
        assert status(one.url + "/") == 403
        assert status(one.url + "/?token=wrong") == 403

        async def work() -> tuple[int, str, int]:
            # A jar that keeps cookies of addresses, as ours has no name.
            jar = aiohttp.CookieJar(unsafe=True)
            async with aiohttp.ClientSession(cookie_jar=jar) as session:
                async with session.get(address(LOOPBACK, one.guard)) as page:
                    status, where = page.status, page.url.path_qs
                async with session.ws_connect(f"{one.url}/live", origin=one.url) as live:
                    await live.send_str('{"do": "stop"}')
                    await live.receive()
            return status, where, len(one.asked)

        assert run(work()) == (200, "/", 1)
    finally:
        one.gateway.close()
