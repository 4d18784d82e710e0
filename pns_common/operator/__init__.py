"""The learned operator: read ``formula`` first; ``scheme`` makes a rule of a model."""
