"""Guardrails and cables from Radon transforms of height-band images (Manandhar and Shibasaki 2002)."""
