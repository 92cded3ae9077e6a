"""Two results side by side: what changed beyond its uncertainty."""
