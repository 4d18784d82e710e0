"""Add-ons that bring the operator into other programs."""
