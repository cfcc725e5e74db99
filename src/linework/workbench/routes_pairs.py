"""Routes of the workbench: pairs."""

from __future__ import annotations

from fastapi import APIRouter

router = APIRouter(prefix="/api")
