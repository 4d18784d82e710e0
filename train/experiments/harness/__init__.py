"""Shared parts of experiments: the laboratory, kept results, tables, figures, the page."""
