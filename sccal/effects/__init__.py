"""What the model of the paper lacks: one physical effect a file, and the catalogue of all of them."""
