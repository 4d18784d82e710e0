"""From bytes to a checked document and its arrays."""
