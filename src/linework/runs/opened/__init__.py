"""What a run opens: points, pairs, path, surface."""
