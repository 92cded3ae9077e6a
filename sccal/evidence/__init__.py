"""What the data say of any set of effects: the saturated fit, the evidence of its subsets, and several runs as one."""
