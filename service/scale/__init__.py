"""Beyond one file: libraries of files, on this machine or on a Ray cluster."""
