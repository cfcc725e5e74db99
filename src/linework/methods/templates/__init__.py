"""Templates of a cross-section: named nodes beside a line, followed with it, each by its own edge."""
