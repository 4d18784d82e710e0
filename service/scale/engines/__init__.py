"""Engines that do tasks: processes of this machine, or a Ray cluster."""
