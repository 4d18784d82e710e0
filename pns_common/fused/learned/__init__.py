"""A learned level: what its rules see, what they add, and the guard of it."""
