"""Addresses: which of them count as one client."""

from __future__ import annotations

from ipaddress import IPv6Address, ip_address, ip_network

# One subscriber of IPv6 is given a /64 at least, often a /56, and a site a /48.
IPV6_NETWORKS = (64, 56, 48)


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
