"""Lines to be reviewed, and what a new extraction carries over."""
