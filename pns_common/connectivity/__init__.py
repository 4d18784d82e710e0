"""What follows from the faces alone: edges and stencils, creases, orders, unions."""
