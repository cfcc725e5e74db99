"""Roads on which things are not what they look like, and which explanation is right where."""
