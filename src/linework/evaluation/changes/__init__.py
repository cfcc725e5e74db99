"""Changes between two surveys of one road."""
