"""What an interior edge sees, and what is learned about it."""
