"""Data sets, grids, patches, parts, simplifiers; in pairs/ the stream for training to limits."""
