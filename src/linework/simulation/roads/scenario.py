"""What stands where on a simulated road, and how the van drives and measures it: plain values.

Offsets `q_m` are from the road's axis, left positive; `start_m`, `end_m` are chainages along it.
"""

from __future__ import annotations

from dataclasses import dataclass

from linework.simulation.roads.alignment import PiecewiseLinear
from linework.simulation.roads.road import Road
from linework.simulation.sensors.heads import Head


@dataclass(frozen=True, slots=True, kw_only=True)
class Marking:
    """A painted line. Dashes start at `start_m`; `wear` is the share of the paint that is gone.

    `shift_m` is added to the offset `q_m`, as a function of chainage: a line along a lane that begins or ends.
    """

    q_m: float
    start_m: float
    end_m: float
    width_m: float
    role: str
    pattern: str = "solid"
    dash_m: float = 0.0
    gap_m: float = 0.0
    double: bool = False
    wear: float = 0.0
    shift_m: PiecewiseLinear | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Symbol:
    """A painted rectangle that is not a line along the road.

    `form` says what it is: a bar of a "zebra" crossing, a "stop" line, the shaft of an "arrow"; "" is a piece
    of the one before it (a step of an arrow's head), "other" has truth without a form (give-way lines, hatching,
    parking bays, letters). With a `role` it is a lane marking across the road: the centre line of a side street.
    """

    start_m: float
    end_m: float
    right_m: float
    left_m: float
    wear: float = 0.0
    form: str = ""
    role: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Island:
    """A raised island: its outline (chainage, offset), anticlockwise and convex, at the foot of its kerb."""

    outline: tuple[tuple[float, float], ...]
    height_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stain:
    """A rectangle of ground that is `shade` times as bright, fading at its edges over `soft_m`: no paint, no truth.

    Wheel tracks, patches, tar seams, wet places, joints, manhole covers, kerb stones, what is left of old paint.
    """

    start_m: float
    end_m: float
    right_m: float
    left_m: float
    shade: float
    soft_m: float = 0.02


#: What a rail may be: folded beams with two and three crests, a square tube, round pipes, ropes.
RAIL_FORMS = ("w_beam", "thrie_beam", "box_beam", "tube", "cable_barrier")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rail:
    """A rail of steel on posts. `q_m` is the middle of its depth; `faces` +1: the traffic is to its left.

    `form` is one of `RAIL_FORMS`. `top_m` is the top of the highest beam; there are `n_beams` of them (pipes, ropes),
    `pitch_m` apart, each `beam_height_m` high and `depth_m` deep. Ends may dip towards the ground over a length
    (`dip_..._m`) and flare away from the road by an amount (`flare_..._m`).
    """

    q_m: float
    faces: int
    start_m: float
    end_m: float
    top_m: float
    beam_height_m: float = 0.31
    depth_m: float = 0.081
    post_every_m: float = 4.0
    post_behind_m: float = 0.0
    has_posts: bool = True
    dip_start_m: float = 0.0
    dip_end_m: float = 0.0
    flare_start_m: float = 0.0
    flare_end_m: float = 0.0
    form: str = "w_beam"
    n_beams: int = 1
    pitch_m: float = 0.0

    @property
    def lower_m(self) -> float:
        """Height of the lower edge of the lowest beam. [m]."""
        return self.top_m - self.beam_height_m - (self.n_beams - 1) * self.pitch_m


@dataclass(frozen=True, slots=True, kw_only=True)
class Barrier:
    """A concrete barrier with its middle at `q_m`; `traffic` lists the sides that traffic passes.

    `profile` is "new_jersey", "f_shape" or "step".
    """

    q_m: float
    start_m: float
    end_m: float
    height_m: float
    foot_width_m: float
    top_width_m: float
    traffic: tuple[int, ...]
    profile: str = "new_jersey"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fence:
    """A fence with its plane at `q_m`: wire "mesh", horizontal "boards", or two "tubes" (a handrail)."""

    q_m: float
    start_m: float
    end_m: float
    height_m: float
    form: str = "mesh"
    post_every_m: float = 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Hedge:
    """A hedge with its middle at `q_m`, bumpy and rough."""

    q_m: float
    start_m: float
    end_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """A wall or a facade (`is_facade`: with windows) with its road-side face at `q_m`."""

    q_m: float
    start_m: float
    end_m: float
    height_m: float
    is_facade: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class House:
    """A house with its middle at a place: eaves at `eaves_m`, roof `rise_m` higher at the ridge (`is_shed`: on one side)."""

    s_m: float
    q_m: float
    length_m: float
    width_m: float
    eaves_m: float
    rise_m: float = 0.0
    is_shed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """A car or lorry; a moving one is drawn out or squeezed by the scanner (`stretch`) and is in one pass."""

    s_m: float
    q_m: float
    length_m: float
    width_m: float
    height_m: float
    heading: int = 1
    is_lorry: bool = False
    stretch: float = 1.0
    only_pass: int = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Pole:
    """A pole, lamp post (`arm_m` > 0: an arm towards the road) or traffic sign."""

    s_m: float
    q_m: float
    height_m: float
    radius_m: float
    arm_m: float = 0.0
    has_sign: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Cable:
    """One wire of one span between two fixings (chainage, offset, height over the ground there).

    `seen_width_m` is the width over which a beam of a few centimetres still returns from the wire.
    """

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    sag_m: float
    wire_m: float = 0.012
    seen_width_m: float = 0.035


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A bush (`trunk_m` = 0) or a tree."""

    s_m: float
    q_m: float
    radius_m: float
    height_m: float
    trunk_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bridge:
    """A bridge across the road."""

    s_m: float
    width_m: float
    clearance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Gantry:
    """A sign gantry over the road from offset `right_m` to `left_m`: four straight chords and a panel."""

    s_m: float
    right_m: float
    left_m: float
    clearance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """What all scanners share.

    `contrast` is the reflectance of paint over asphalt; intensity goes with range to the power `-range_power`
    and with the cosine of incidence to `incidence_power`; `drift` is its slow change over the survey.
    Stray points lie at 0.2 to 1.4 times the range of what the beam met, or off that range by `stray_m`, from and to.
    """

    range_noise_m: float
    max_range_m: float
    intensity_bits: int
    contrast: float
    gain: float
    range_power: float
    incidence_power: float
    drift: float
    drift_period_s: float
    stray_share: float
    stray_m: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One drive along the road; `direction` -1 goes against chainage."""

    q_m: float
    direction: int
    speed_mps: float
    wander_m: float
    pose_error_m: tuple[float, float, float]
    start_time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What goes wrong in a survey; see `linework.simulation.sensors.conditions` for how much of it is drawn.

    Parameters
    ----------
    zero_counts
        What the intensity of nothing is.
    gain
        For each beam, counted through the heads: how bright it sees things.
    boresight_rad
        For each head: small rotation about x, y and z of the vehicle that the calibration does not know.
    delay_s
        How late the times are by which points get their poses.
    wander_m
        Slow error of the poses of a pass: amplitude along each axis.
    mirror_share
        Share of the beams on cars, glass and steel that come back from what these mirror.
    rain_share
        Share of the beams that come back from a drop before they meet anything.
    """

    zero_counts: float
    gain: tuple[float, ...]
    boresight_rad: tuple[tuple[float, float, float], ...]
    delay_s: float
    wander_m: float
    mirror_share: float
    rain_share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A straight flight strip from `start_m` (local frame); the aircraft sways by `sway_rad` about its course."""

    start_m: tuple[float, float, float]
    heading_rad: float
    length_m: float
    speed_mps: float
    sway_rad: float
    pose_error_m: tuple[float, float, float]
    start_time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Station:
    """A scanner on a tripod at `place_m` (local frame), for as long as one scan takes."""

    place_m: tuple[float, float, float]
    yaw_rad: float
    duration_s: float
    pose_error_m: tuple[float, float, float]
    start_time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadLayout:
    """The road and all that stands on and beside it.

    `lanes` are the (offset, direction) the van may drive; `far_edges_m` are offsets of further pavement
    edges: a motorway's other carriageway; `closed_m` are (start, end, right, left) of pavement that paint closes to
    traffic.
    """

    road: Road
    lanes: tuple[tuple[float, int], ...]
    speed_mps: float
    markings: tuple[Marking, ...] = ()
    symbols: tuple[Symbol, ...] = ()
    rails: tuple[Rail, ...] = ()
    barriers: tuple[Barrier, ...] = ()
    fences: tuple[Fence, ...] = ()
    hedges: tuple[Hedge, ...] = ()
    walls: tuple[Wall, ...] = ()
    cars: tuple[Car, ...] = ()
    poles: tuple[Pole, ...] = ()
    cables: tuple[Cable, ...] = ()
    plants: tuple[Plant, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    gantries: tuple[Gantry, ...] = ()
    far_edges_m: tuple[float, ...] = ()
    stains: tuple[Stain, ...] = ()
    houses: tuple[House, ...] = ()
    islands: tuple[Island, ...] = ()
    closed_m: tuple[tuple[float, float, float, float], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Everything a seed decides; the survey follows from it without further choices but noise.

    With `flights` or `stations`, these carry the scanners instead of the vehicle of `passes`. `holes_m` are stretches,
    from and to chainage, of which no points were delivered.
    """

    kind: str
    seed: int
    length_m: float
    origin_m: tuple[float, float, float]
    layout: RoadLayout
    scanners: tuple[Head, ...]
    sensor: Sensor
    passes: tuple[Pass, ...]
    scanner: str = "default"
    flights: tuple[Flight, ...] = ()
    stations: tuple[Station, ...] = ()
    conditions: Conditions | None = None
    holes_m: tuple[tuple[float, float], ...] = ()

    @property
    def is_driven(self) -> bool:
        """Whether a vehicle carries the scanners."""
        return not (self.flights or self.stations)
