"""Which kernels the methods call, and with which types of arguments.

Separate from `linework.kernels.compiling`, which reads it: a table to be kept up to date. A test runs every method, and
fails with the lines that are missing here.
"""

from __future__ import annotations

#: A kernel, ``=``, the groups of methods that call it, and below it the types of its arguments, each call on a line:
#: dtype, for an array ``:`` with dimensions and layout and ``!`` where it is read-only; tuples in brackets, named ones
#: after the name of their class.
CALLED_WITH = """
boundaries.boundary_boxes.boxes_at_stripes = paint boundaries
    boundaries.profiles.FloorCells(f8:2C,i8:1C,i8:1C,f8:2C,f8:2C,b1:1C,b1:1C,i8:1C) (f4:2C,f8,i8,i8) (i8:1C,f8:1C) boundaries.profiles.FloorLimits(f8,f8,f8,f8,f8) f8:2C
    boundaries.profiles.FloorCells(f8:2C,i8:1C,i8:1C,f8:2C,f8:2C,b1:1C,b1:1C,i8:1C) (f4:2C,f8,i8,i8) (i8:1C,f8:1C!) boundaries.profiles.FloorLimits(f8,f8,f8,f8,f8) f8:2C
boundaries.boundary_boxes.boxes_in_cells = paint boundaries
    boundaries.profiles.FloorCells(f8:2C,i8:1C,i8:1C,f8:2C,f8:2C,b1:1C,b1:1C,i8:1C) (f4:2C,f8,i8,i8) (i8:1C,f8:1C) boundaries.profiles.FloorLimits(f8,f8,f8,f8,f8) (f8,f8,f8,f8)
    boundaries.profiles.FloorCells(f8:2C,i8:1C,i8:1C,f8:2C,f8:2C,b1:1C,b1:1C,i8:1C) (f4:2C,f8,i8,i8) (i8:1C,f8:1C!) boundaries.profiles.FloorLimits(f8,f8,f8,f8,f8) (f8,f8,f8,f8)
boundaries.evenness.unevenness_beside = paint boundaries
    f8:2C i8:1C f8:2C
boundaries.walls.points_of_walls = paint boundaries
    f8:2C i8:1C i8:1C
cables.catenary.derivatives = cables
    f8 f8 f8
cables.catenary.fit = cables
    f8:1C f8:1C f8:1C i8 i8
cables.catenary.residuals = cables
    f8:2C (f8,f8,f8,f8) cables.catenary.WireCurve(f8,f8,f8,f8)
cables.catenary.wire_height = cables
    f8 cables.catenary.WireCurve(f8,f8,f8,f8)
cables.catenary.wire_heights = cables
    f8:1C cables.catenary.WireCurve(f8,f8,f8,f8)
cables.fit.best_break = cables
    f8:1C f8:1C f8 f8 i8
cables.fit.on_wire = cables
    f8:1C f8:1C f8:1C cables.fit.OnWireEdges(f8,f8,f8) cables.fit.OnWireRadii(f8,f8,f8)
cables.fit.robust_line = cables
    f8:1C f8:1C f8
cables.fit.robust_parabola = cables
    f8:1C f8:1C f8:1C f8
cables.fit.station_runs = cables
    f8:1C f8 f8 f8
cables.fit.tukey = cables
    f8:1C f8
cables.mixture.settle_mixture = cables
    f8:2C f8:3C f8:1C (f8,f8) cables.mixture.MixtureLimits(f8,f8,f8)
cables.search.best_curve = cables
    (f8:1C,f8:1C,f8:1C) b1:1C (f8:1C,f8:1C) (f8,f8,f8,f8)
cables.search.crowding = cables
    i8:1C i8:1C i4:1C i4:1C i8
cables.search.near_segment = cables
    i8:1C i8:1C i8:1C f8:1C f8:2A f8:1C f8
cables.tube.grow = cables
    f8:1C f8:1C f8:1C b1:1C f8:1C f8
cables.tube.settle = cables
    f8:1C f8:1C f8:1C b1:1C cables.search.SliceCurve(f8,f8,f8) f8
cables.tube.thinness = cables
    f8:1C f8:1C f8:1C b1:1C f8:1C
cells.bins.choose_near = rails
    f8:2C! f4:1C (f8,f8,f8) b1:2C i8 (f8,f8)
cells.bins.sort_into_bins = rails
    f8:2C! f4:1C i8:1C f8:1C f8 i8 i8
cells.bins.sort_into_layers = rails
    f8:2C i8:1C
cells.bins.steps_to_set = paint boundaries
    b1:2C i8
cells.blocks.lowest_of_blocks = paint boundaries rails cables points
    f4:2C i8 i8 i8 i8 i8
cells.blocks.supported_lowest = paint boundaries rails cables points
    f4:3C f8 i8
cells.floor.cells_near_ground = paint boundaries
    f8:2C! f8:1C f8 i8 i8 f4:2C b1:2C (f8,f8)
cells.floor.facets_of = paint boundaries
    f8:2C i8:1C i8:1C
cells.floor.sort_by_cell = paint boundaries
    f8:2C! f4:1C! f8:1C i8:1C i8:1C i8:1C
cells.floor.write_sums = paint boundaries
    f8:2C i8:1C i8:1C f8:2C
cells.floor.write_sums_without = paint boundaries
    f8:2C f8:2C i8:1C i8:1C b1:1C i8:1C f8:2C
cells.nearest.blend_into_ground = paint boundaries rails cables points
    f4:2C i4:2C f4:2C f4:2C i8:1C i8:1C f8 f8
cells.nearest.block_sums = paint boundaries rails cables points
    f4:2C b1:2C i8:1C i8:1C i8 i8 f8
cells.nearest.heights_by_index = paint boundaries rails cables points
    f4:2C i4:2C
cells.nearest.nearest_known_squared = paint boundaries rails cables points
    b1:2C i8 i8
cells.nearest.softened = paint boundaries rails cables points
    f4:2C i4:2C i8 f8 f8
cells.openings.lower_limits = paint boundaries rails cables points
    f4:2C f4:2C i8:1C i8:1C f4:2C i8:1C i8:1C f8
cells.openings.lowered_by_slope = paint boundaries rails cables points
    f4:2C i8 f8 f8
cells.openings.opened = paint boundaries rails cables points
    f4:2C i8
cells.openings.supported_cells = paint boundaries rails cables points
    f4:2C b1:2C i8 f8 f8 i8
cells.openings.without_pits = paint boundaries rails cables points
    f4:2C f8
cells.planes.interpolated = paint boundaries rails cables points
    i8:3C b1:2C i8:1C i8 f8 i8 i8
cells.planes.summed_moments = paint boundaries rails cables points
    f4:2C b1:2C i8
cells.rasterise.count_in_band = rails
    f8:2C! f4:1C! f8 f8 f8:1C i8 i8
cells.regions.drops_below = paint boundaries rails cables points
    f8:2C i8 i8 f4:2C f8 f8 i8
cells.regions.label_regions = paint boundaries rails cables points
    f4:2C f4:2C f4:2C b1:2C f8 f8 b1
cells.regions.links_across = paint boundaries rails cables points
    f4:2C f4:2C i4:2C f4:2C f4:2C i4:2C f8 f8
cells.regions.sizes_of_labels = paint boundaries rails cables points
    i4:2C i4:2C i8
cells.regions.with_labels = paint boundaries rails cables points
    i4:2C b1:1C
cells.surface.above_strays = paint boundaries rails cables points
    i4:1C f4:1C f4:2C i4:2C i4:2C f8 i8 f8
cells.surface.count_in_steps = paint boundaries rails cables points
    f4:2C f8 i8
cells.surface.height_above = rails cables classes
    f8:2C f8 f8 f8 f8 f4:2C
    f8:2C! f8 f8 f8 f8 f4:2C
cells.surface.lowest_layer = paint boundaries rails cables points
    i4:1C f4:1C f4:2C f8
cells.surface.lowest_supported = paint boundaries rails cables points
    f8:2C! i8 i8 i8 i8 f8 f8 f8
cells.surface.median_slopes = paint boundaries rails cables points
    f4:2C b1:2C f8 i8 i4:2C
classes.near_lines.cells_of_pieces = classes
    f8:2C f8:1C f8 f8 i8 i8
classes.near_lines.in_sight = classes
    f8:2C f8:2C classes.near_lines.NearLines(f8:2C,u1:1C,u1:1C,u4:1C,f8:1C,f8:1C,i4:1C,i4:1C,f8,f8,i8,i8)
classes.paint.on_and_beside = classes
    f8:2C! i8:1C classes.near_lines.NearLines(f8:2C,u1:1C,u1:1C,u4:1C,f8:1C,f8:1C,i4:1C,i4:1C,f8,f8,i8,i8)
classes.points.give_classes = classes
    f8:2C! f4:1C i8:1C classes.points.PlanCells(f4:2C,u1:2C,f8,f8,f8,f8) classes.near_lines.NearLines(f8:2C,u1:1C,u1:1C,u4:1C,f8:1C,f8:1C,i4:1C,i4:1C,f8,f8,i8,i8) classes.standing.Cubes(i4:1C,i4:1C,u1:1C,f8,f8,f8,i8,i8) u1:1C u4:1C
    f8:2C f4:1C i8:1C classes.points.PlanCells(f4:2C,u1:2C,f8,f8,f8,f8) classes.near_lines.NearLines(f8:2C,u1:1C,u1:1C,u4:1C,f8:1C,f8:1C,i4:1C,i4:1C,f8,f8,i8,i8) classes.standing.Cubes(i4:1C,i4:1C,u1:1C,f8,f8,f8,i8,i8) u1:1C u4:1C
classes.standing.cube_numbers = classes
    f8:2C f8 f8 f8 i8 i8 i8
classes.standing.cube_sums = classes
    f8:2C i8:1C i8:1C f8 f8 f8 i8 i8
classes.standing.labels_of_cubes = classes
    classes.standing.Cubes(i4:1C,i4:1C,u1:1C,f8,f8,f8,i8,i8) f8:2C f4:2C f8
images.fuse.fuse = pairs
    f8:2C i8:1C i8:1C (f8,f8,f8,i8) f8 (f8,f8)
images.fuse.looked_at = pairs
    f8:2C f8:2C i8:1C (f8,f8,f8,i8) (f8,f8,f8,f8)
images.link_stripes.fit_at = pairs
    f8:1C f8:1A f8:1C f8:1C f8:1C
    f8:1C f8:1C f8:1C f8:1C f8:1C
images.link_stripes.link = pairs
    f8:2C i8:1C i8 f8 (f8,i8)
images.link_stripes.partners = pairs
    f8:2F i8:1C f8:2F i8:1C i8 f8:1C
images.road_disparity.best_plane = pairs
    f8:2C i8:2C f8:2C f8
images.road_disparity.cell_disparities = pairs
    u1:2C! u1:2C! f8:2C (i8,i8) i8
images.row_stripes.stripes_of_rows = pairs
    u1:2C! f8:1C f8 (i8,i8) (f8,f8) (f8,f8)
navigation.antenna = trajectory
    f8:1C f8:1C f8:1C f8:1C! f8:1C f8:2C
navigation.filter_forward = trajectory
    f8:1C f8:2C f8:2C f8:2C i8:1C f8:2C! f8:2C! f8:2C f8:1C f8:1C
navigation.smooth_backward = trajectory
    f8:2C f8:3C f8:2C f8:1C
paint.paint_points.bright_centres = paint boundaries
    f8:2C i8:1C i8 f8
paint.paint_points.cells_near_road = paint boundaries
    f8:2C! f8:1C (f8,i8,i8,f8) f4:2C b1:2C f8 (f8,i8,i8,i8,i8)
paint.paint_points.count_bright = paint boundaries
    f8:2C i8:1C i8 f8
paint.paint_points.sort_into_cells = paint boundaries
    f8:2C! f4:1C! f8:1C f8:1C i4:1C i8
    f8:2C! f4:1C! f8:1C! f8:1C i4:1C i8
paint.rhythm.best_rhythm = paint pairs
    b1:1C f8 (f8,f8) (f8,f8,f8) (f8,f8) f8
paint.scan_rows.evened_rows = paint boundaries
    f8:2C i8:1C (f8,i8,i8,i8,i8) f8:2C
paint.stripes_ahead.cells_ahead = paint boundaries
    f8:2C i8:1C (f8,i8,i8,i8,i8) f8:2C b1:1C f8
paint.stripes_all.all_stripes = paint boundaries
    f8:2C i8:1C (f8,i8,i8,i8,i8) i8:1C f8:2C f8:1C f8
radon.bands.bands_of_rows = rails
    f8:2C i8
radon.bands.fold_of_rows = rails
    f8:2C f8:1C f8
radon.bands.middles_of_rows = rails
    f8:2C f8:1C
radon.bands.number_near = rails
    f8:2C f8:1C f8:1C f8
radon.corridor.find_beam_starts = rails
    f8:2C i8:1C i8 i8 f8 f8:2C f8:1C radon.corridor.BeamShape(f8,f8,f8,f8,f8,f8,f8,f8,f8) f8:2C
radon.follow.follow_sheets = rails
    f8:2C (i8:1C,f8:1C,i8:2C) (i8,i8,f8) f8:2C radon.follow.FollowSettings(f8,f8,f8,f8,f8,f8,f8) (f8,f8) radon.follow.FollowLimits(i8,i8,i8) f8:2C
radon.peaks.peaks = cables
    f8:2C f8:1C f8:1C f8 f8 i8
radon.outlines.flat_costs = rails
    f8:1C f8:1C f8:1C f8
radon.outlines.likeliest_view = rails
    i8:2C f8:1C f4:3C f4:2C i8:1C f8 i8
radon.sections.count_outlines = rails
    f8:2C i8:1C i8 i8 f8 f8:2C i8:2C f8 f8 (f8,f8) f8 f8:2C
radon.sections.fit_lines_locally = rails
    f8:1C f8:1C f8:1C f8 i8:1C
radon.sections.profile_along = rails
    f8:2C i8:1C i8 i8 f8 f8:2C f8 f8 f8 radon.sections.EdgeShape(f8,f8,f8) f8:2C
radon.segments.peaks_of_windows = rails
    f8:2C i8:1C (i8:2C,f8:2C) ((f8,f8,f8),f8) f8:1C f8:1C (f8,f8,i8) f8
radon.segments.segments_of = rails
    b1:2C f8 f8:2C i8:2C f8:2C f8:1C f8 i8 i8
radon.transform.radon = cables
    f8:1C f8:1C f8:1C (f8,f8,f8) f8:1C f8 i8
scanlines.strings.share_interleaved = paint boundaries rails cables
    i4:1C
scanlines.strings.speed_of_spot = paint boundaries rails cables
    f8:1C f8:2C i8:1C f8
scanlines.strings.time_back_at_place = paint boundaries rails cables
    f8:1C f8:2C i8:1C f8 f8 f8
scanlines.strings.track_strings = paint boundaries rails cables
    f8:1C f8:2C f8 f8 f8
scanlines.strips.cuts_of_strips = paint boundaries rails cables
    f8:1C f8:2C (f8,f8) b1 f8 f8 f8
scanlines.strips.mean_motion = paint boundaries rails cables
    f8:1C f8:2C f8
scanlines.turn_planes.sum_of_turns = paint boundaries rails cables
    scanlines.turn_planes.Looks(i8:1C,i8:1C,i8:1C,f8:2C) f8:1C f8:1C i8:2C i8
scanlines.turn_planes.turns_that_meet = paint boundaries rails cables
    scanlines.turn_planes.Looks(i8:1C,i8:1C,i8:1C,f8:2C) i8
scanlines.turns.cuts_of_turns = paint boundaries rails cables
    f8:1C f8:1C f8:1C
scanlines.turns.in_order_of_ties = paint boundaries rails cables
    i8:1C f8:1C! f8:2C!
scanlines.turns.turn_of_points = paint boundaries rails cables
    f8:1C f8:1C
store.columns.checksums_of_columns = columns
    u4:2C i8:1C
store.columns.settle_by_columns = columns
    u8:1C u2:1C u4:2C (u8:1C,i4:1C,u8:1C,i4:1C)
store.order.first_damaged = paint boundaries rails cables points
    u8:1C u8:1C u2:1C i8:1C b1:1A u8:1A
    u8:1C u8:1C u2:1C i8:1C b1:1C u8:1C
store.order.keep_inside = paint boundaries rails cables points
    u8:1C u8:1C u2:1C i8:1C i4:1C
store.order.sort_points = paint boundaries rails cables points
    u8:1C u8:1C u2:1C (u8:1C,i4:1C,u8:1C,i4:1C)
store.order.unpack_points = paint boundaries rails cables points
    u8:1C u8:1C u2:1C i4:1C i8:1C (f8:2C,u8:1C,f4:1C) i8
store.pack.blocks_of = paint boundaries rails cables points
    u8:1C
store.pack.describe_runs = paint boundaries rails cables points
    u8:1C i8:2C i8:1C b1
store.pack.pack_points = paint boundaries rails cables points
    f8:2C! u8:1C i4:1C i8:1C i8
store.pack.scatter_runs = paint boundaries rails cables points
    u8:1C u2:1C! f8:1C! i4:1C i8:2C u8:1C
tracking.beside.stations_beside = paint boundaries pairs
    i8:2C i8:1C f8:2C f8:2C (f8,f8,f8)
tracking.passing.passing = rails
    f8:2C i8:1C i8:1C (i8,i8,f8) (f8,f8)
tracking.smooth.smooth_height = paint boundaries pairs
    f8:1C f8:1C f8:1C f8
tracking.smooth.smooth_plane = paint boundaries pairs
    f8:1C f8:2C f8:1C f8:1C
tracking.times.moving_sums = rails
    f8:2C i8:1C i8
tracking.times.points_near = rails
    f8:2C! f8:2C i8:1C f8
    f8:2C! f8:2C! i8:1C f8
tracking.times.times_near = rails cables
    f8:2C! f8:1C! f8:2C i8:1C i8 f8
tracking.track.support = paint boundaries pairs
    f8:2C i8:1C (f8,f8,f8,i8) f8
tracking.track_all.track_all = paint boundaries pairs
    f8:2C i8:1C (f8,f8,f8,i8) i8:1C (f8,f8,f8,b1,f8) f8:1C i8
"""
