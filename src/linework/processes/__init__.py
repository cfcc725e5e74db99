"""Child processes: the only room that starts one. How they start, their messages, how they end; a pool of workers."""
