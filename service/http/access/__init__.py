"""Identify clients: the address behind a proxy, the name behind a key."""
