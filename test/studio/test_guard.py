"""Who may come in: by Host, Origin and token."""

from __future__ import annotations

import pytest

from msrd_ros.studio.guard import Guard

HERE = Guard(8080)
EXPOSED = Guard(8080, "a-secret")


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "[::1]:8080"])
def test_our_own_page_comes_in(host: str) -> None:
    assert HERE.refusal({"Host": host, "Origin": f"http://{host}"}, "", drives=True) == ""


@pytest.mark.parametrize(
    "host", ["", "127.0.0.1", "127.0.0.1:8081", "studio.example:8080", "127.0.0.1:8080.example"]
)
def test_a_name_that_was_made_to_point_here_does_not(host: str) -> None:
    assert "is not this studio" in HERE.refusal({"Host": host, "Origin": f"http://{host}"}, "", drives=True)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:8080", "http://127.0.0.1:8081", ""]
)
def test_anybody_elses_page_does_not(origin: str) -> None:
    headers = {"Host": "127.0.0.1:8080", "Origin": origin}
    assert "may not use this studio" in HERE.refusal(headers, "", drives=False)


def test_who_drives_says_where_the_page_is_from() -> None:
    headers = {"Host": "127.0.0.1:8080"}
    assert HERE.refusal(headers, "", drives=False) == ""
    assert "no origin" in HERE.refusal(headers, "", drives=True)


@pytest.mark.parametrize("token", ["", "another", "a-secre", "a-secret "])
def test_exposed_it_wants_the_token(token: str) -> None:
    headers = {"Host": "robot.example:8080", "Origin": "http://robot.example:8080"}
    assert "token" in EXPOSED.refusal(headers, token, drives=True)
    assert EXPOSED.refusal(headers, "a-secret", drives=True) == ""
    assert EXPOSED.refusal({**headers, "Origin": "http://evil.example"}, "a-secret", drives=True)
