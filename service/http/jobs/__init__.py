"""Jobs that clients come back for: taken in, kept, and shared between replicas."""
