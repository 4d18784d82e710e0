"""A level as kernels see it: what it is measured to be, and Loop's step of it."""
