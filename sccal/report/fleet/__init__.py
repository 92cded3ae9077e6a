"""Many runs: the page of all of them, the table, and what CI servers read."""
