"""What stands on a simulated road."""
