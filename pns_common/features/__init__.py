"""What the network reads of an edge's surroundings, and in which order."""
