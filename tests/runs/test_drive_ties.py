"""Lines that tie drives over one road, and where they hold."""

import numpy as np
import pytest
from tests.scenes.two_drives import path_of, straight

from linework.model.lines import LineSet
from linework.runs.drives.adjusted import adjusted_drives
from linework.runs.drives.separate import separate_drives
from linework.runs.drives.ties import meet_lines, tie_drives


def dashes(shift_m):
    lines = [
        np.array([[s + shift_m, 2.0, 0.0], [s + shift_m + 3.0, 2.0, 0.0]]) for s in np.arange(5.0, 290.0, 9.0)
    ]
    return LineSet.from_lines(lines, kind=["lane_marking_dash"] * len(lines))


def test_ties_are_across_in_height_and_along_at_dashes():
    path = path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((300.0, 3.0), (0.0, 3.0)))
    drives = separate_drives(path)
    one = LineSet.concatenate([straight(5.0), straight(-4.0, kind="road_boundary"), dashes(0.0)])
    other = LineSet.concatenate([straight(5.1, 0.04), straight(-3.9, 0.04, "road_boundary"), dashes(0.2)])
    adjusted = adjusted_drives(drives, path, [one, other])
    shift = [adjusted.correction.at(np.array([d.time_s.mean()]))[0] for d in drives]
    # The middle of both: east at dashes, north across, up
    np.testing.assert_allclose(shift[0], [0.1, 0.05, 0.02], atol=0.01)
    np.testing.assert_allclose(shift[1], [-0.1, -0.05, -0.02], atol=0.01)
    np.testing.assert_allclose(adjusted.accounted().apart_m[1], 0.04, atol=1e-6)
    assert max(adjusted.accounted().left_apart_m) < 0.003
    assert "2 drives adjusted" in adjusted.accounted().summary


def test_lines_along_a_part_of_the_shared_road_do_not_hold_all_of_it():
    path = path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((300.0, 3.0), (0.0, 3.0)))
    drives = separate_drives(path)
    whole, part = straight(5.0), straight(5.0)
    part = LineSet.from_lines([part.xyz[:250]], kind=["lane_marking"])
    assert adjusted_drives(drives, path, [whole, straight(5.1)]).is_held
    partly = adjusted_drives(drives, path, [whole, part])
    assert not partly.is_held
    assert partly.untied_xy[:, 0].min() == pytest.approx(247.5, abs=1.0)
    assert partly.untied_xy[:, 0].max() == pytest.approx(300.0, abs=1.0)
    # What is found for these places ties the drives there, and nowhere else
    edges = [straight(-4.0, kind="road_boundary"), straight(-3.9, kind="road_boundary")]
    met = meet_lines(drives, edges, partly.untied_xy)
    ties = tie_drives(drives, edges, met, None, reach_m=0.5)
    assert np.interp(ties.time_s, path.time_s, path.xyz[:, 0]).min() >= 220.0
    both = [LineSet.concatenate([one, other]) for one, other in zip([whole, part], edges, strict=True)]
    assert adjusted_drives(drives, path, both).is_held
    # However far apart its poses are
    fast = separate_drives(
        path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((300.0, 11.0), (0.0, 11.0)), speed=36.0)
    )
    assert len(fast[0].xy) < 10
    untied = adjusted_drives(fast, path, [whole, part]).untied_xy
    assert untied[:, 0].min() < 252.0 and untied[:, 0].max() > 285.0
    # Drives of which one also passes where the other does not need no tie there
    path = path_of(((0.0, 0.0), (600.0, 0.0)), 60.0, ((300.0, 3.0), (0.0, 3.0)))
    assert adjusted_drives(separate_drives(path), path, [whole, straight(5.1)]).is_held


def test_drives_without_a_line_in_common_stay():
    path = path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((300.0, 3.0), (0.0, 3.0)))
    drives = separate_drives(path)
    assert adjusted_drives(drives, path, [straight(5.0), straight(15.0)]) is None
    assert adjusted_drives(drives, path, [straight(5.0), straight(5.0, kind="kerb_top")]) is None
    assert adjusted_drives(drives, path, [LineSet.empty(), LineSet.empty()]) is None


def test_pipes_one_above_another_are_tied_each_to_itself():
    drives = separate_drives(path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((0.0, 1.0), (300.0, 1.0))))

    def pipes(across_m, up_m):
        rails = [straight(5.0 + k * across_m, 0.5 + 0.4 * k + up_m, "guardrail") for k in (0, 1)]
        return LineSet.concatenate(rails).with_columns(form="tube")

    first, second = pipes(0.0, 0.0), pipes(0.01, 0.02)
    ties = tie_drives(drives, [first, second], meet_lines(drives, [first, second]), None, reach_m=0.5)
    high = ties.normal[:, 2] > 0.5
    assert high.any()
    assert np.abs(ties.apart_m[high]) == pytest.approx(0.02, abs=1e-6)


def test_three_drives_weigh_as_much_as_they_are():
    legs = [((0.0, 0.0), (300.0, 0.0)), 60.0, ((0.0, 1.0), (300.0, 1.0)), 60.0, ((0.0, 2.0), (300.0, 2.0))]
    two, three = (separate_drives(path_of(*legs[:n])) for n in (3, 5))
    lines = [straight(5.0), straight(5.02), straight(5.04)]
    of_two = tie_drives(two, lines[:2], meet_lines(two, lines[:2]), None, reach_m=0.5)
    of_three = tie_drives(three, lines, meet_lines(three, lines), None, reach_m=0.5)
    # 3 pairs of which 2 are independent
    weight = [np.sum(1.0 / ties.sigma_m**2) for ties in (of_two, of_three)]
    np.testing.assert_allclose(weight[1] / weight[0], 2.0, rtol=0.02)
