"""One step of a scheme, one after the other, and what is reported of each."""
