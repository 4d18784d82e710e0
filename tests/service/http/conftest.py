"""A service alone, one behind the proxy of deploy/, and a client of a module's own service."""

from __future__ import annotations

from collections.abc import Iterator

import httpx2
import pytest

from tests.support.live import GLB, served
from tests.support.proxy import proxied

MIB = 2**20


@pytest.fixture(scope="module", params=["alone", "behind the proxy"])
def front(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[str, int]]:
    """The address of a service of small bodies, which waits for nobody for long."""
    if request.param == "alone":
        with served(workers=1, body=MIB, idle_seconds=0.5, keep_alive_seconds=1) as address:
            yield address
    else:
        folder = tmp_path_factory.mktemp("front")
        with (
            served(workers=1, body=MIB, proxies="127.0.0.1") as behind,
            proxied(behind, folder) as address,
        ):
            yield address


@pytest.fixture
def client(address: tuple[str, int]) -> Iterator[httpx2.Client]:
    """A client of the `address` of a module's own service."""
    with httpx2.Client(
        base_url=f"http://{address[0]}:{address[1]}", headers=GLB, timeout=600
    ) as opened:
        yield opened
