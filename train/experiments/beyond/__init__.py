"""Tables and figures of what the paper leaves open: the bundled models, real meshes, stars."""
