"""Certificates T1–T8: each module states one property, measures it, and can fail."""
