"""The store of decoded points: built once, read by place."""
