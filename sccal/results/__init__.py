"""Every type of result, and the one converter that writes them all as JSON and reads them again."""
