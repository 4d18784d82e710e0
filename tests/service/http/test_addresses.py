"""Addresses that count as one client, and the pace at which clients must send."""

import pytest

from service.http.body_limits import Pace
from service.http.clients import sites

PACE = Pace(rate=100, grace=10, idle=4, whole=60)


@pytest.mark.parametrize(
    ("moved", "waited", "patience", "excuse"),
    [
        (0, 0, 4, "nothing for 4 seconds"),
        (0, 8, 2, None),
        (0, 10, 0, "slower than 100 bytes a second"),
        (100, 10, 1, None),
        (10_000, 59, 1, None),
        (10_000, 60, 0, "not whole within 60 seconds"),
    ],
)
def test_a_client_may_be_late_but_not_slow(moved, waited, patience, excuse):
    assert PACE.patience(moved, waited) == patience
    if excuse is not None:
        assert PACE.excuse(moved, waited) == excuse


@pytest.mark.parametrize(
    ("address", "name"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8::1", "2001:db8::/64"),
        ("2001:db8::ffff:0:1", "2001:db8::/64"),
        ("2001:db8:0:1::1", "2001:db8:0:1::/64"),
        ("not an address", "not an address"),
    ],
)
def test_an_ipv6_client_is_its_network(address, name):
    assert sites(address)[0] == name


@pytest.mark.parametrize(
    ("address", "networks"),
    [
        ("192.0.2.1", ("192.0.2.1",)),
        ("::ffff:192.0.2.1", ("192.0.2.1",)),
        (
            "2001:db8:1:2345::1",
            ("2001:db8:1:2345::/64", "2001:db8:1:2300::/56", "2001:db8:1::/48"),
        ),
        ("a socket", ("a socket",)),
    ],
)
def test_an_address_counts_for_the_networks_that_it_is_in(address, networks):
    assert sites(address) == networks
