"""Worker processes of the workbench: requests to them, and the survey that they keep open."""
