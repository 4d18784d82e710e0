"""Analytic surfaces: implicit functions, distances and gradients, of one or of many instances."""
