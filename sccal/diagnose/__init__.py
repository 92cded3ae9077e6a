"""Closing the loop: find what the data hold that the model does not, name it, add it, and judge before and after."""
