"""Addresses: which of them count as one client, and which are named."""

from __future__ import annotations

from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network

Network = IPv4Network | IPv6Network
# What one subscriber of IPv6 is given: its addresses are one address here.
IPV6_SITE = 64


def is_named(address: str, networks: tuple[Network, ...]) -> bool:
    """Return whether an address lies in one of the networks; what is no address lies in none."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return False
    if isinstance(parsed, IPv6Address) and parsed.ipv4_mapped:
        parsed = parsed.ipv4_mapped
    return any(parsed in network for network in networks)


def site(address: str) -> str:
    """Return the address that counts for a client's share: of IPv6 the network, others whole."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    if not isinstance(parsed, IPv6Address):
        return address
    if parsed.ipv4_mapped:
        return str(parsed.ipv4_mapped)
    return str(ip_network((int(parsed), IPV6_SITE), strict=False))
