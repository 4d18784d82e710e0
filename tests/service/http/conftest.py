"""A service alone, and one behind the proxy of deploy/."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.live import served
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
