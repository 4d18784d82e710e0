"""Observation: a line and a count for each request, metrics, traces."""
