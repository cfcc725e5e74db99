"""Several drives over one road: separated, tied together by their own lines, and corrected."""
