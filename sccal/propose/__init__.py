"""What a user's own files hold, found by names and checked by numbers, as a vehicle.toml."""
