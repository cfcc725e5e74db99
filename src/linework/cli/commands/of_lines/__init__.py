"""Commands that work on finished lines: convert, compare with a reference, report, publish."""
