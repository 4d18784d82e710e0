"""One step of a scheme, one after the other, and what is told and reported of each."""
