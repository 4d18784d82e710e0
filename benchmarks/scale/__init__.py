"""Libraries of files, and meshes larger than memory: what they take."""
