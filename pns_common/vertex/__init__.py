"""What an old vertex sees of its ring, and what is learned about it."""
