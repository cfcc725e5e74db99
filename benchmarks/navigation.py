"""How far positions are off in GNSS outages, real time and smoothed, and whether the sigmas are honest.

``python -m benchmarks navigation``: simulated drives over all grades of sensors, seeds 950-969;
``python -m benchmarks.navigation --turns``: turns of 9 m, by rear wheels, by front wheels, and by these taken for rear;
``python -m benchmarks.navigation --real FOLDER`` hides the GNSS of the recorded drives in FOLDER (dresden.csv,
berlin_odometry_first140s.txt, berlin_reference_first140s.txt) for stretches, and scores against it.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.accuracy import seeds_of
from linework.navigation.locate import locate_drive
from linework.simulation.sensors.logs import (
    GNSS_1_M,
    GNSS_2_CM,
    GYROS,
    SensorGrades,
    WheelGrade,
    attitude_deg,
    simulate_logs,
)
from linework.simulation.sensors.long_drives import MOTORWAY, URBAN, long_drive

KINDS = {"urban": URBAN, "motorway": MOTORWAY}
RECEIVERS = {"2 cm": GNSS_2_CM, "1 m": GNSS_1_M}
OUTAGES_S = (10.0, 30.0, 60.0, 120.0)
#: Gyros of the better half.
BETTER = (0, 1)


@dataclass(frozen=True)
class Outage:
    """One outage: way driven in it [m], largest horizontal error smoothed and in real time [m]."""

    kind: str
    receiver: str
    gyro: int
    length_s: float
    way_m: float
    smoothed_m: float
    forward_m: float
    sigma_m: float

    @property
    def is_within(self):
        return self.smoothed_m <= 0.001 * self.way_m + 2.0 * self.sigma_m


def main(arguments=()):
    options = parsed(arguments)
    if options.real:
        from benchmarks._real_drives import report_real

        report_real(Path(options.real))
        return
    if options.turns:
        report_turns(seeds_of(options.seeds))
        return
    outages, ratios = [], []
    for seed in seeds_of(options.seeds):
        for kind in KINDS:
            for receiver in RECEIVERS:
                for gyro in range(len(GYROS)):
                    found, ratio = driven(seed, kind, receiver, gyro)
                    outages += found
                    ratios.append((kind, receiver, gyro, *ratio))
        if options.progress:
            print(f"seed {seed} done", flush=True)
    report(outages, ratios)


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.navigation")
    parser.add_argument("--seeds", default="950-969", help="first-last, or a list")
    parser.add_argument("--real", default="", help="folder of recorded drives")
    parser.add_argument("--turns", action="store_true", help="only turns of 9 m, by rear and by front wheels")
    parser.add_argument("--progress", action="store_true")
    return parser.parse_args(list(arguments))


def driven(seed, kind, receiver, gyro):
    """Return the outages of one drive of 10 minutes, and its errors over sigmas: plan, height, roll to heading."""
    rng = np.random.default_rng([seed, gyro, list(KINDS).index(kind), list(RECEIVERS).index(receiver)])
    drive = long_drive(KINDS[kind], 600.0, rng)
    spans, at = [], 60.0
    for length in rng.permutation(OUTAGES_S):
        at += rng.uniform(40.0, 60.0)
        spans.append((at, at + length))
        at += length
    wheels = WheelGrade(
        scale_left=rng.uniform(-0.02, 0.02),
        scale_right=rng.uniform(-0.02, 0.02),
        slip=rng.uniform(0.001, 0.006),
    )
    grade = replace(GYROS[gyro], scale=GYROS[gyro].scale * rng.choice([-1.0, 1.0]))
    grades = SensorGrades(gnss=RECEIVERS[receiver], gyro=grade, wheels=wheels)
    located = locate_drive(simulate_logs(drive, grades, rng, outages_s=spans), rate_hz=10.0)
    smoothed, turned = errors_of(drive, located.trajectory)
    forward, _ = errors_of(drive, located.forward)
    time = located.trajectory.time_s
    sigma = float(np.hypot(grades.gnss.white_m, grades.gnss.wander_m))
    outages = []
    for start, end in spans:
        inside = (time > start) & (time < end)
        gone = (drive.time_s > start) & (drive.time_s < end)
        way = float(np.sum(np.linalg.norm(np.diff(drive.xyz[gone], axis=0), axis=1)))
        worst = [float(np.hypot(*e[inside, :2].T).max()) for e in (smoothed, forward)]
        outages.append(Outage(kind, receiver, gyro, end - start, way, *worst, sigma))
    plan = (smoothed / located.trajectory.sigma_xyz_m) ** 2
    angles = (turned / located.trajectory.sigma_attitude_deg) ** 2
    return outages, (plan[:, :2].mean(), plan[:, 2].mean(), *angles.mean(axis=0))


def report_turns(seeds):
    """Print the largest horizontal errors in outages of 30 and 60 s on drives that turn by 90 degrees every 20 to 60 m."""
    kind = replace(URBAN, turn_share=1.0, stop_share=0.0, turn_m=(9.0, 9.0), leg_m=(20.0, 60.0))
    outages = {"30 s": (100.0, 130.0), "60 s": (180.0, 240.0)}
    names = "rear wheels", "front wheels", "front wheels taken for rear ones"
    errors, ratios = {(n, o): [] for n in names for o in outages}, {n: [] for n in names}
    for seed in seeds:
        drive = long_drive(kind, 300.0, np.random.default_rng([seed, 11]))
        for name in names:
            grades = SensorGrades(
                gnss=GNSS_2_CM, gyro=GYROS[1], wheels=WheelGrade(scale_left=0.012, scale_right=-0.006),
                counts_front=name != names[0],
            )  # fmt: skip
            logs = simulate_logs(
                drive, grades, np.random.default_rng([seed, 12]), outages_s=[*outages.values()]
            )
            if name == names[2]:
                logs = replace(logs, wheelbase_m=0.0)
            located = locate_drive(logs, rate_hz=10.0).trajectory
            off = errors_of(drive, located)[0][:, :2]
            for length, (start, end) in outages.items():
                inside = (located.time_s > start) & (located.time_s < end)
                errors[name, length].append(np.hypot(*off[inside].T).max())
            ratios[name].append(np.mean((off / located.sigma_xyz_m[:, :2]) ** 2))
    print(
        f"turns of 9 m, wheelbase {grades.wheelbase_m:g} m, GNSS 2 cm, gyro 1, {len(ratios[names[0]])} drives of 300 s:"
    )
    print(
        "largest horizontal error in an outage, median and 95 % [m]; rms(error / sigma) in plan over the drives"
    )
    for name in names:
        parts = [
            f"{o}: {np.median(errors[name, o]):.3f} ({np.percentile(errors[name, o], 95):.3f})"
            for o in outages
        ]
        print(f"  {name:32} {'   '.join(parts)}   {np.sqrt(np.mean(ratios[name])):.2f}")


def errors_of(drive, poses):
    """Return errors of position [m] and of roll, pitch, heading [deg] at the poses."""
    true = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in drive.xyz.T], axis=1)
    turned = np.stack([np.interp(poses.time_s, drive.time_s, c) for c in attitude_deg(drive).T], axis=1)
    off = poses.attitude_deg - turned
    off[:, 2] = (off[:, 2] + 180.0) % 360.0 - 180.0
    return poses.xyz - true, off


def report(outages, ratios):
    print("largest horizontal error in an outage, smoothed / real time: median and 95 % [m], within the goal")
    print("(goal: 0.1 % of the way + 2 sigmas of the GNSS; asked of gyros 0 and 1)")
    for receiver in RECEIVERS:
        for kind in KINDS:
            for gyro, grade in enumerate(GYROS):
                print(f"GNSS {receiver}, {kind}, gyro {gyro}: {grade.drift_deg_h:g} deg/h, "
                      f"{grade.noise_deg_sqrt_h:g} deg/sqrt(h)")  # fmt: skip
                own = [o for o in outages if (o.receiver, o.kind, o.gyro) == (receiver, kind, gyro)]
                for length in OUTAGES_S:
                    print(_line([o for o in own if abs(o.length_s - length) < 0.5], f"{length:5.0f} s"))
    better = [o for o in outages if o.gyro in BETTER]
    for receiver in RECEIVERS:
        for name, some in (("better half", better), ("all", outages)):
            own = [o for o in some if o.receiver == receiver]
            print(
                f"GNSS {receiver}, {name}: {sum(o.is_within for o in own)} of {len(own)} outages within the goal"
            )
    print("rms(error / sigma) over all seeds: plan, height, roll, pitch, heading (goal 0.7 to 1.5)")
    for receiver in RECEIVERS:
        for kind in KINDS:
            for gyro in range(len(GYROS)):
                rows = np.array([r[3:] for r in ratios if r[:3] == (kind, receiver, gyro)])
                print(
                    f"  GNSS {receiver:5} {kind:9} gyro {gyro}: "
                    + "  ".join(f"{v:.2f}" for v in np.sqrt(rows.mean(axis=0)))
                )


def _line(some, name):
    smoothed, forward = (np.array([getattr(o, f) for o in some]) for f in ("smoothed_m", "forward_m"))
    way = np.array([o.way_m for o in some])
    gain = np.sqrt(np.mean(smoothed**2) / np.mean(forward**2))
    return (
        f"  {name}: way {np.median(way):6.0f} m  {np.median(smoothed):6.3f} ({np.percentile(smoothed, 95):6.3f}) / "
        f"{np.median(forward):6.3f} ({np.percentile(forward, 95):7.3f})  gain {gain:.2f}  "
        f"within {sum(o.is_within for o in some)} of {len(some)}"
    )


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
