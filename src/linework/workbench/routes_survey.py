"""Routes of the workbench: survey."""

from __future__ import annotations

from fastapi import APIRouter

router = APIRouter(prefix="/api")
