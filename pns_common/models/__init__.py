"""What a model is and says of itself, and the bundled model files."""
