"""The rules for old vertices and for edges: Loop's, the paper's, the default's."""
