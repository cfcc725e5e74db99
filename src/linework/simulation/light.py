"""Light and exposure of a simulated drive: what the seed decides about every image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.grain import grain


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """Sun, sky and how the cameras are set.

    Parameters
    ----------
    to_sun
        (3,) unit vector, local frame.
    sun
        Light of the sun on a surface that faces it, over that of the sky on level ground; 0: overcast.
    asphalt_grey
        Grey value of lit asphalt, which decides the exposure.
    asphalt
        Reflectance of the asphalt.
    contrast
        Reflectance of paint over that of asphalt.
    glare
        How much asphalt mirrors at grazing angles.
    noise_grey
        Standard deviation of the noise on lit asphalt. [grey values]
    blur_px
        Standard deviation of the lens's blur. [pixels]
    exposure_s
        How long the shutter is open.
    gain_right
        Grey values of the right camera over those of the left one.
    vignetting
        Share of the light that is lost in a corner.
    """

    to_sun: FloatArray
    sun: float
    asphalt_grey: float
    asphalt: float
    contrast: float
    glare: float
    noise_grey: float
    blur_px: float
    exposure_s: float
    gain_right: float
    vignetting: float

    @property
    def gain(self) -> float:
        """Grey values per unit of light that comes from a surface (reflectance 1 under the open sky alone: 1)."""
        return self.asphalt_grey / (self.asphalt * (1.0 + self.sun * max(float(self.to_sun[2]), 0.0)))


def draw_light(rng: np.random.Generator) -> Light:
    """Return what a seed decides; ranges beside each.

    Direct light over diffuse: 3 to 8 under a clear sky. Outdoor exposures are 1 to 4 ms.
    """
    elevation, azimuth = np.radians(rng.uniform(10.0, 70.0)), rng.uniform(0.0, 2.0 * np.pi)
    is_overcast = rng.random() < 0.35
    to_sun = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    return Light(
        to_sun=np.array(to_sun),
        sun=float(rng.uniform(3.0, 8.0)) * (not is_overcast),
        asphalt_grey=float(rng.uniform(60.0, 110.0)),
        asphalt=float(rng.uniform(0.09, 0.16)),
        contrast=float(rng.uniform(1.3, 4.0)),
        glare=float(rng.uniform(0.0, 0.5)),
        noise_grey=float(rng.uniform(1.0, 4.0)),
        blur_px=float(rng.uniform(0.4, 1.0)),
        exposure_s=float(rng.uniform(0.001, 0.004)),
        gain_right=float(rng.uniform(0.93, 1.07)),
        vignetting=float(rng.uniform(0.0, 0.25)),
    )


def sky_and_hills(direction: FloatArray, light: Light, pixel_rad: float, seed: int) -> FloatArray:
    """Return the light from (n, 3) directions that meet nothing of the scene: wooded hills, above them the sky."""
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    # Mirrored, so that west has no seam
    azimuth, elevation = np.abs(np.arctan2(unit[:, 1], unit[:, 0])), np.arcsin(unit[:, 2])
    n, level, fine = len(unit), np.zeros(len(unit)), np.full(len(unit), pixel_rad)

    def noise(finest_rad: float, growth: float, n_octaves: int, salt: int, y: FloatArray) -> FloatArray:
        return grain(
            azimuth, y, fine, fine, np.full(n, finest_rad), np.full(n, growth), n_octaves, seed + salt
        )

    ridge = np.radians(3.0) + 0.004 * noise(0.01, 1.5, 6, 1, level)
    woods = (
        0.055
        * (1.0 + 0.5 * light.sun * abs(light.to_sun[2]))
        * np.exp(0.2 * noise(0.002, 1.1, 6, 2, elevation))
    )
    clouds = 1.0 + 0.03 * noise(0.01, 1.4, 6, 3, 3.0 * elevation)
    towards_sun = np.clip(unit @ light.to_sun, 0.0, 1.0) ** 6 * (light.sun > 0.0)
    sky = clouds * (0.8 + 0.8 * np.exp(-np.maximum(elevation, 0.0) / 0.25)) * (1.0 + 1.5 * towards_sun)
    share = np.clip((ridge - elevation) / pixel_rad + 0.5, 0.0, 1.0)
    return np.asarray(share * woods + (1.0 - share) * sky)
