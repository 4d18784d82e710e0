"""Each request is counted for its client."""

from __future__ import annotations

import pytest
from fastapi import Request

from service.http.clients import Client, client_of
from service.settings import Settings


def request(address: tuple[str, int] | None, **state: object) -> Request:
    return Request({"type": "http", "client": address, "state": state, "headers": []})


@pytest.mark.parametrize(
    ("address", "client"),
    [
        ("192.0.2.7", "address:192.0.2.7"),
        ("::ffff:192.0.2.7", "address:192.0.2.7"),
        # A provider hands out whole /64 networks.
        ("2001:db8:1:2:3:4:5:6", "address:2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::1", "address:2001:db8:1:2::/64"),
        ("testclient", "address:testclient"),
    ],
)
def test_an_address_is_a_client_and_has_the_services_budget(address: str, client: str) -> None:
    settings = Settings(faces_per_minute=77)
    assert client_of(request((address, 1)), settings) == Client(client, 77)


def test_a_request_from_nowhere_is_a_client_too() -> None:
    assert client_of(request(None), Settings()).id == "address:"


def test_a_client_that_was_found_before_stands() -> None:
    named = Client("key:mine", 5, named=True)
    assert client_of(request(("192.0.2.7", 1), client=named), Settings()) is named
