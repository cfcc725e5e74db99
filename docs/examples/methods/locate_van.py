"""
Where was the van?
==================

GNSS, gyro and wheels together: in an outage the path is carried on by dead reckoning, and a smoother that also looks
back from the next fix keeps the error small. This page drives through a tunnel.
"""

import matplotlib.pyplot as plt
import numpy as np

from linework.navigation.locate import locate_drive
from linework.navigation.poses import poses_at
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, simulate_logs
from linework.simulation.simulate import drives_of

# %%
# Logs
# ----
#
# 600 m of road with bends; no fixes for 15 s in the middle.

scenario = draw_scenario("bends", 5, 600.0)
true_drive = drives_of(scenario)[0]
logs = simulate_logs(
    true_drive,
    SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[2]),
    np.random.default_rng(1),
    outages_s=[(15.0, 30.0)],
)
print(f"{len(logs.gnss.time_s)} fixes over {logs.gnss.time_s[-1] - logs.gnss.time_s[0]:.0f} s")

# %%
# Filter and smoother
# -------------------

located = locate_drive(logs, rate_hz=10.0)
print(
    f"{located.distance_m:.0f} m, outages: {np.diff(located.outages_s, axis=1).ravel().round(1).tolist()} s"
)
for name, (value, sigma) in located.stretches[0].estimates.items():
    print(f"{name:20} {value:10.4f} +- {sigma:.4f}")

# %%
# Forward only, as known while driving, and smoothed: the standard deviation says how well each position is known.

fig, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
smoothed, forward = located.trajectory, located.forward
origin, start = smoothed.xyz[0, :2], smoothed.time_s[0]
axes[0].plot(*(smoothed.xyz[:, :2] - origin).T, "k", lw=1)
axes[0].plot(*(logs.gnss.xyz[::5, :2] - origin).T, ".", ms=3, color="tab:blue")
axes[0].set_aspect("equal")
axes[0].set_title("path and fixes")
for path, label in ((forward, "forward"), (smoothed, "smoothed")):
    assert path.sigma_xyz_m is not None
    axes[1].plot(path.time_s - start, 100.0 * np.hypot(*path.sigma_xyz_m[:, :2].T), label=label)
axes[1].set(xlabel="time [s]", ylabel="sigma in plan [cm]", ylim=(0, None))
axes[1].legend()

# %%
# Against the truth
# -----------------
#
# The simulation knows where the van really was.

inside = (smoothed.time_s > true_drive.time_s[0]) & (smoothed.time_s < true_drive.time_s[-1])
truth = np.column_stack([np.interp(smoothed.time_s[inside], true_drive.time_s, v) for v in true_drive.xyz.T])
error = np.hypot(*(smoothed.xyz[inside] - truth)[:, :2].T)
print(f"error in plan: median {100 * np.median(error):.1f} cm, largest {100 * error.max():.1f} cm")

# %%
# Positions at any times, with their standard deviations:

three = poses_at(smoothed, smoothed.time_s[0] + np.array([5.0, 22.0, 40.0]))
print(np.round(np.hypot(*three.sigma_xyz_m[:, :2].T), 3))
plt.show()
