"""Guardrails and concrete barriers."""
