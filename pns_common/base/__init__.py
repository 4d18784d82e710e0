"""What knows no geometry: arrays of any backend, work in row blocks, whole files."""
