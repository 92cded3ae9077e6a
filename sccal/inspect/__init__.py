"""What is in a log, before anything is estimated."""
