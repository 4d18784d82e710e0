"""A service alone, one behind the proxy of deploy/, and a client of a module's own service."""

import httpx2
import pytest

from tests.support.live import GLB, served
from tests.support.proxy import proxied

MIB = 2**20


@pytest.fixture(scope="module", params=["alone", "behind the proxy"])
def front(request, tmp_path_factory):
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
def client(address):
    """A client of the `address` of a module's own service."""
    url = f"http://{address[0]}:{address[1]}"
    with httpx2.Client(base_url=url, headers=GLB, timeout=600) as opened:
        yield opened
