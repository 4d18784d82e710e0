"""What a document must keep so that it can be refined, and what breaks glTF and is reported."""
