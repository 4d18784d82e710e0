"""What the networks read of an edge and of a vertex's ring, and in which order."""
