"""The web server: its routes, the guard in front of them, and the state they share."""
