"""The workbench: a server on this machine and the page it serves, for tracing, reviewing and editing lines.

The server (`server`, and `routes` of the other rooms) answers requests and never opens a survey. What takes time runs
in worker processes (`worker`), which have the survey open. The page is built from the folder `page` of the repository
into `page/` here.
"""
