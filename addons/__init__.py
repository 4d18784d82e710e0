"""What brings the operator into other programs."""
