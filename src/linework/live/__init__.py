"""Following a survey while the van records it: pairs looked at as they arrive, lines so far, the operator's keys."""
