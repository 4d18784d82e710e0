"""Other libraries' Loop, each behind the same protocol in a process of its own."""
