"""The laboratory: networks, analytic surfaces, losses, trainer and metrics (torch)."""
