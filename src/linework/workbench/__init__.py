"""The workbench: a server on this machine and the page it serves, for tracing, reviewing and editing lines.

The server (`server`, `routes_*`) answers; it never opens a survey. What takes time is done by processes beside it
(`desk`, `desk_process`), which have the survey open (`table`). The page is built from the folder `page` of the
repository and lies in `page/` here.
"""
