"""What is added to Loop: q = q0 + G[γ Π(D + τ h F z(φ))], each part in a file of its own."""
