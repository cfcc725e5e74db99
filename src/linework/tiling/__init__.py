"""From a survey to its lines: tiles, the run over them, its record."""
