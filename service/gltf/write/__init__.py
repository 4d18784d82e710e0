"""Refined primitives into the document: accessors, compression, what is no longer used."""
