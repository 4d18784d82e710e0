"""Addresses: which of them count as one client, and which are proxies."""

from __future__ import annotations

from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

Network = IPv4Network | IPv6Network
# One subscriber of IPv6 is given a /64 at least, often a /56, and a site a /48.
IPV6_NETWORKS = (64, 56, 48)


def is_named(address: str, networks: tuple[Network, ...]) -> bool:
    """Return whether an address lies in one of the networks; False where it is no address."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return False
    if isinstance(parsed, IPv6Address) and parsed.ipv4_mapped:
        parsed = parsed.ipv4_mapped
    return any(parsed in network for network in networks)


def site(address: str) -> str:
    """Return the address that counts for a client's share: of IPv6 the /64, others whole."""
    return sites(address)[0]


def sites(address: str) -> tuple[str, ...]:
    """Return the networks whose shares an address counts for, the narrowest first."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return (address,)
    if not isinstance(parsed, IPv6Address):
        return (address,)
    if parsed.ipv4_mapped:
        return (str(parsed.ipv4_mapped),)
    return tuple(str(ip_network((int(parsed), length), strict=False)) for length in IPV6_NETWORKS)
