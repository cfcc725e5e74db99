"""What a person asks of a survey, as an order to extract its lines."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from linework.methods.choose import choose_methods, stereo_method
from linework.model.survey import Survey
from linework.tiling.extract_to import Order
from linework.tiling.settings import RunSettings


def asked_order(
    output: Path,
    survey: Survey,
    kinds: tuple[str, ...],
    method: str,
    settings: RunSettings,
    *,
    crs: str = "",
    overwrite: bool = False,
    resume: bool = False,
) -> Order:
    """Return the order to look for `kinds` by a method ("auto": what suits each kind).

    Parameters
    ----------
    survey
        As its recordings have it: its trajectory may have been located.
    crs
        As it was given, for the record.
    """
    return Order(
        output=output,
        methods=choose_methods(method, kinds, radon=settings.radon, obb=settings.obb),
        stereo=stereo_method(method, kinds, settings.stereo),
        settings=settings,
        parameters={
            "features": list(kinds),
            "method": method,
            "crs": crs or None,
            "trajectory": str(survey.trajectory_file) if survey.trajectory_file else None,
            "lever_m": list(survey.trajectory_lever_m),
            "cameras": survey.settings.get("cameras"),
            "settings": asdict(settings),
        },
        overwrite=overwrite,
        resume=resume,
    )
