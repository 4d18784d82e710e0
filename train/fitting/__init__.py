"""Training: differentiable steps, losses, trainers, and what keeps their bits the same."""
