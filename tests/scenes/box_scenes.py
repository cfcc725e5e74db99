"""Made-up boxes along lines whose course is known."""

import numpy as np

from linework.model.boxes import BoxForm, BoxSet


def straight(length, *, y=0.0, x=0.0, heading=0.0, every=0.45):
    """Places and directions of a straight line."""
    t = np.arange(0.2, length, every)
    u = np.array([np.cos(heading), np.sin(heading)])
    return np.array([x, y]) + t[:, None] * u, np.tile(u, (len(t), 1))


def bend(radius, angle, *, every=0.45, x=0.0, y=0.0):
    """Places and directions of a left-hand bend that begins at (x, y) towards the east."""
    a = np.arange(0.2, radius * angle, every) / radius
    xy = np.column_stack([x + radius * np.sin(a), y + radius * (1.0 - np.cos(a))])
    return xy, np.column_stack([np.cos(a), np.sin(a)])


def boxes_on(*courses, noise=0.01, seed=0, form=BoxForm.STRIPE, keep=1.0, z=0.0, flip=True):
    """Boxes on courses, their centres off by `noise` across, some left out, stripes turned either way."""
    rng = np.random.default_rng(seed)
    xy, u = (np.concatenate(parts) for parts in zip(*courses, strict=True))
    kept = rng.random(len(xy)) < keep
    xy, u = xy[kept], u[kept]
    n = len(xy)
    left = np.column_stack([-u[:, 1], u[:, 0]])
    xy = xy + left * (noise * rng.normal(size=n))[:, None]
    turn = 2.0 * noise * rng.normal(size=n)
    u = u * np.cos(turn)[:, None] + left * np.sin(turn)[:, None]
    if flip and form == BoxForm.STRIPE:
        u = u * rng.choice([-1.0, 1.0], n)[:, None]
    is_kerb = form == BoxForm.KERB
    return BoxSet(
        centre=np.column_stack([xy, z + 0.004 * rng.normal(size=n)]),
        u=u,
        half_u_m=np.full(n, 0.22),
        half_v_m=np.full(n, 0.06),
        sigma_v_m=np.full(n, noise),
        sigma_z_m=np.full(n, 0.004),
        sigma_u_rad=np.full(n, 2.0 * noise),
        score=np.full(n, 0.9),
        form=np.full(n, form),
        height_m=0.12 + 0.003 * rng.normal(size=n) if is_kerb else np.full(n, np.nan),
        top_v_m=np.full(n, -0.03 if is_kerb else np.nan),
        rougher=np.full(n, 1.0 if is_kerb else np.nan),
    )


def everything_seen(xy):
    """Ground was measured everywhere."""
    return np.ones(len(xy), dtype=bool)


def nothing_seen(xy):
    """No ground was measured anywhere."""
    return np.zeros(len(xy), dtype=bool)
