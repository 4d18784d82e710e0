"""Who asks: the address behind a proxy, the name behind a key."""
