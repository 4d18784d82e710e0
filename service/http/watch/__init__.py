"""What operators see: a line and a count for each request, metrics, traces."""
