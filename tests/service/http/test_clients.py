"""Each request is counted for its client."""

from __future__ import annotations

import asyncio
from contextlib import ExitStack

import pytest
from fastapi import Request

from service.errors import BusyError
from service.http.access.clients import (
    Client,
    FacesBudget,
    OverBudgetError,
    Places,
    TooManyRequestsError,
    client_of,
)
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
def test_who_sends_no_key_is_the_client_of_its_address(address: str, client: str) -> None:
    settings = Settings(faces_per_minute=77)
    assert client_of(request((address, 1)), settings) == Client(client, 77)
    assert client_of(request(None), settings) == Client("address:", 77)
    named = Client("key:mine", 5)
    assert client_of(request((address, 1), client=named), settings) is named


def test_a_client_has_so_many_places_and_all_together_so_many() -> None:
    places = Places(4, own=2)
    with ExitStack() as held:
        for client in "aabb":
            held.enter_context(places.held(client))
        with pytest.raises(TooManyRequestsError, match="as many as one client may") as own:
            held.enter_context(places.held("a"))
        assert (own.value.status, own.value.retry_after) == (429, 2)
        with pytest.raises(BusyError, match="4 requests") as full:
            held.enter_context(places.held("c"))
        assert full.value.status == 503
    assert places.taken == {}
    with places.held("a"):
        assert places.taken == {"a": 1}


@pytest.mark.anyio
async def test_a_slow_reader_gives_its_place_to_a_client_who_holds_less() -> None:
    """Two addresses that hardly read their answers would else close the service."""
    places, ended = Places(4, own=3), []

    async def takes(client: str) -> None:
        end = asyncio.timeout(None)
        with places.held(client), places.taking(client, end):
            try:
                async with end:
                    await asyncio.sleep(60)
            except TimeoutError:
                ended.append(client)

    slow = [asyncio.create_task(takes(client)) for client in "aaab"]
    await asyncio.sleep(0)
    with pytest.raises(BusyError), places.held("b"), places.held("b"), places.held("b"):
        pass
    with places.held("honest"):
        await asyncio.sleep(0.01)
    assert ended == ["a"] * 2
    for task in slow:
        task.cancel()
    await asyncio.gather(*slow, return_exceptions=True)


def test_a_budget_refills_evenly_and_a_job_may_leave_a_debt() -> None:
    now = [0.0]
    budget, client = FacesBudget(lambda: now[0]), Client("a", 60)
    budget.check(client)
    budget.charge(client, 90)
    with pytest.raises(OverBudgetError) as over:
        budget.check(client)
    assert (over.value.status, over.value.retry_after) == (429, 31)
    budget.check(Client("b", 60))
    now[0] = 30.5
    budget.check(client)
    unbounded = Client("c", None)
    budget.charge(unbounded, 10**9)
    budget.check(unbounded)
