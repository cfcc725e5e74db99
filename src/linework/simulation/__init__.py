"""Surveys with exact truth: a road, a drive along it, the scanner's rays."""
