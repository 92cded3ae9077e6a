"""The compiled kernel, its forward pass over one aligned run, where it starts, and the noise it assumes."""
