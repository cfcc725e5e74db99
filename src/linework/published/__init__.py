"""The methods as their papers describe them."""
