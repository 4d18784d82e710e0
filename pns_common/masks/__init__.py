"""Loop's masks (Loop 1987): one step's, over any columns, and those of the limit surface."""
