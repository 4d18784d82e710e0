"""Speed and memory against peers, as commands; never asserted in a test."""
