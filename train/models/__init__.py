"""What is trained: recipes, networks, their checkpoints, and the author's published networks."""
