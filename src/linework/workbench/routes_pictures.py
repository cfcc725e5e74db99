"""Routes of the workbench: pictures."""

from __future__ import annotations

from fastapi import APIRouter

router = APIRouter(prefix="/api")
