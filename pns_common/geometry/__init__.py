"""What is measured on a mesh: frames of edges, rings of vertices, thin faces, child faces."""
