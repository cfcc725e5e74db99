"""Routes of the workbench: review."""

from __future__ import annotations

from fastapi import APIRouter

router = APIRouter(prefix="/api")
