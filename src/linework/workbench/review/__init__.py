"""The review queue as the page asks for it."""
