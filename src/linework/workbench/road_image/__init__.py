"""The road as the cameras saw it, laid down on its surface: a background of the plan."""
