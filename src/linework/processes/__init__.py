"""Child processes: a pool, a conversation, their limits."""
