"""Files of a survey while the van fills them: logs and lists that grow, and what is noted of them at once."""
