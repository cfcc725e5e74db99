"""What the worker process keeps open for the page."""
