"""The sparse Radon transform against scikit-image's, and rasterising 4 million points."""

import time

import numpy as np
from skimage.transform import radon as skimage_radon

from linework.imaging.raster import grid_for, in_height_band, rasterise
from linework.methods.radon.peaks import find_peaks
from linework.methods.radon.transform import evenly_spaced_angles, radon_of_cells, radon_transform
from linework.model.grid import Grid, Image
from linework.model.points import Points


def best_s(call, n):
    """Return the shortest of n wall times; a first call, which compiles, is not timed."""
    call()
    times = []
    for _ in range(n):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def main():
    rng = np.random.default_rng(1)
    n, n_angles = 1000, 360
    image = rng.random((n, n)) < 0.01
    angles = evenly_spaced_angles(180.0 / n_angles)
    ours = Image(image, Grid(0.0, 200.0, 0.2, 0.2, n, n))
    ours_s = best_s(lambda: radon_transform(ours, angles), 7)
    # Theirs once over all angles: some ten seconds
    theirs, degrees = image.astype(float), np.degrees(angles)
    start = time.perf_counter()
    skimage_radon(theirs, degrees, circle=False)
    theirs_s = time.perf_counter() - start
    print(f"radon transform, {n} x {n} cells, {image.sum():,} occupied, {n_angles} angles")
    print(f"  linework {ours_s * 1e3:9.1f} ms")
    print(f"  skimage  {theirs_s * 1e3:9.1f} ms   ratio {theirs_s / ours_s:,.0f} (asked for: 200)")

    def with_peaks() -> None:
        radon = radon_transform(ours, angles)
        windows = {"theta_window_rad": 0.1, "rho_window_m": 1.0}
        find_peaks(radon.values, radon.angles_rad, radon.rho_m, threshold=5.0, **windows)

    peaks_s = best_s(with_peaks, 5)
    print(f"  with its peaks {peaks_s * 1e3:.1f} ms")
    _window(rng)
    _raster(rng)


def _window(rng):
    x, y, weights = rng.uniform(-6, 6, 200), rng.uniform(-6, 6, 200), np.ones(200)
    angles = evenly_spaced_angles(2.0)

    def windows():
        for _ in range(1000):
            radon_of_cells(
                x, y, weights, cell_width_m=0.2, cell_height_m=0.2,
                angles_rad=angles, rho_step_m=0.2, rho_max_m=8.5,
            )  # fmt: skip

    print(f"window of 200 cells, {len(angles)} angles: {best_s(windows, 5) * 1e3:.0f} us each")


def _raster(rng):
    n = 4_000_000
    along = np.repeat(np.linspace(0.0, 1000.0, n // 500), 500)
    across = np.tile(np.linspace(-15.0, 15.0, 500), n // 500)
    xyz = np.column_stack([664_000.0 + along, 5_080_000.0 + across, 200.0 + rng.normal(0.0, 1.0, n)])
    points = Points(xyz, intensity=rng.integers(0, 255, n).astype(np.float32))
    height = (xyz[:, 2] - 200.0).astype(np.float32)
    grid = grid_for(points, 0.2)
    raster_s = best_s(lambda: rasterise(points, grid), 5)
    band_s = best_s(lambda: in_height_band(points.xyz, height, grid, 0.2, 1.2), 5)
    print(f"{n:,} points on {grid.n_rows:,} x {grid.n_cols:,} cells")
    print(f"  all images   {raster_s * 1e3:6.1f} ms")
    print(f"  binary image {band_s * 1e3:6.1f} ms")


if __name__ == "__main__":
    main()
