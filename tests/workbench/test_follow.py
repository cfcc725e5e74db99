"""Following lines over the WebSocket: what grows, why it stops, what is refused, what is kept."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.workbench.follow_talk import longest, talk_with
from websockets.exceptions import ConnectionClosed

from linework.files.vectors.read_write import read_lines
from linework.lines.companions import nearest_vertex


@pytest.fixture(scope="module")
def truth(made_drive):
    return read_lines(made_drive / "truth.gpkg")


@pytest.fixture
def talk(served):
    with talk_with(served) as talk:
        yield talk


def place_on(truth, kind, share=0.5):
    line = longest(truth, kind)
    return np.round(line[int(share * (len(line) - 1)), :2], 3).tolist()


def off_m(line, truth):
    return np.array([nearest_vertex(truth[:, :2], xy)[1] for xy in np.array(line["xyz"])[:, :2]])


@pytest.mark.parametrize("kind", ["lane_marking", "road_boundary"])
def test_a_picked_line_grows_and_stops(talk, truth, kind):
    at = place_on(truth, kind)
    area, *grown, stopped = talk.follow(type="pick", at=at, kind=kind)
    corners = np.array(area["corners"])
    assert area["type"] == "area"
    assert corners.shape == (4, 2) and np.abs(corners.mean(axis=0) - at).max() < 0.01
    assert grown and {news["type"] for news in grown} == {"grown"}
    assert {news["trace"] for news in [*grown, stopped]} == {stopped["trace"]}
    lengths = [news["lines"][0]["length_m"] for news in grown]
    assert lengths == sorted(lengths)
    assert stopped["type"] == "stopped" and not stopped["interrupted"]
    line = stopped["lines"][0]
    assert line["kind"] == kind and line["length_m"] > 20.0
    assert np.quantile(off_m(line, longest(truth, kind)), 0.9) < 0.1
    assert stopped["distance_m"] <= 0.5
    assert all(stopped["stops"]) and len(stopped["choices"]) == 2


def test_a_place_on_no_line_is_refused_with_a_place_that_works(talk, truth):
    lane, rim = longest(truth, "lane_marking")[:, :2], longest(truth, "road_boundary")[:, :2]
    over = np.array([rim[np.argmin(np.hypot(*(rim - xy).T))] for xy in lane])
    middles = 0.5 * (lane + over)
    clear = [min(nearest_vertex(truth[i].xyz[:, :2], xy)[1] for i in range(len(truth))) for xy in middles]
    assert max(clear) > 0.8
    *_, refused = talk.follow(type="pick", at=middles[int(np.argmax(clear))].tolist(), kind="")
    assert refused["type"] == "refused" and refused["reason"] and refused["advice"]
    assert refused["works_px"] is None
    *_, stopped = talk.follow(type="pick", at=refused["works"], kind="")
    assert stopped["type"] == "stopped"


@pytest.mark.parametrize(
    "order",
    [
        {"type": "pick"},
        {"type": "pick", "at": [1.0, "x"], "kind": ""},
        {"type": "pick", "at": [1e300, 0.0], "kind": ""},
        {"type": "pick", "at": [1.0, 2.0], "kind": "hedge"},
        {"type": "pick", "at": [1.0, 2.0], "kind": "", "path": "/etc/passwd"},
        {"type": "bridge", "trace": "nothing", "end": "end"},
        {"type": "pick_image", "pair": 10**6, "side": "left", "at_px": [1, 1], "kind": ""},
        {"type": "steal"},
        [],
    ],
)
def test_an_order_that_makes_no_sense_is_refused_and_the_socket_stays(talk, truth, order):
    talk.socket.send(json.dumps(order))
    told = talk.hear_all()
    assert told[-1]["type"] == "refused" and told[-1]["reason"]
    assert talk.follow(type="pick", at=place_on(truth, "lane_marking"), kind="")[-1]["type"] == "stopped"


def test_text_that_is_no_json_is_refused(talk):
    talk.socket.send("{")
    assert talk.hear()["type"] == "refused"


def test_an_interrupt_gives_what_there_is(talk, truth):
    talk.say(type="pick", at=place_on(truth, "road_boundary"), kind="road_boundary")
    while talk.hear()["type"] != "grown":
        pass
    talk.say(type="interrupt")
    *_, stopped = talk.hear_all()
    assert stopped["type"] == "stopped" and stopped["interrupted"]
    assert "it was interrupted there" in stopped["stops"]
    assert any("bridge" in choices for choices in stopped["choices"])


def test_an_order_that_waits_is_dropped_by_an_interrupt(served_alone, truth):
    # The server is still warming up, or another's line is followed: the worker is not free at once
    with talk_with(served_alone) as first, talk_with(served_alone) as second:
        first.say(type="pick", at=place_on(truth, "road_boundary"), kind="road_boundary")
        second.say(type="pick", at=place_on(truth, "lane_marking"), kind="lane_marking")
        second.say(type="interrupt")
        told = second.hear_all()
        assert told[-1]["type"] == "refused" or told[-1]["interrupted"]
        if told[-1]["type"] == "refused":
            assert [news["type"] for news in told] == ["refused"]
            assert "before it had begun" in told[-1]["reason"]
        again = second.follow(type="pick", at=place_on(truth, "lane_marking"), kind="lane_marking")
        assert again[-1]["type"] == "stopped"


def test_toward_follows_one_way(talk, truth):
    line = longest(truth, "lane_marking")
    at = place_on(truth, "lane_marking")
    *_, stopped = talk.follow(type="pick", at=at, kind="lane_marking", toward=line[-1, :2].tolist())
    assert "it was picked there" in stopped["stops"]
    xy = np.array(stopped["lines"][0]["xyz"])[:, :2]
    way = line[-1, :2] - at
    assert ((xy - at) @ way).min() > -2.0 * np.hypot(*way)


def test_a_new_pick_leaves_the_one_before(talk, truth):
    talk.say(type="pick", at=place_on(truth, "road_boundary"), kind="road_boundary")
    talk.say(type="pick", at=place_on(truth, "lane_marking"), kind="lane_marking")
    told = talk.hear_all()
    assert told[-1]["type"] == "stopped"
    if told[-1]["lines"][0]["kind"] != "lane_marking":  # it was whole before the second came
        told = talk.hear_all()
    assert told[-1]["lines"][0]["kind"] == "lane_marking"


def test_a_page_that_goes_leaves_the_worker_free(served, truth):
    with talk_with(served) as gone:
        gone.say(type="pick", at=place_on(truth, "road_boundary"), kind="road_boundary")
        gone.hear()
    with talk_with(served) as talk:
        assert talk.follow(type="pick", at=place_on(truth, "lane_marking"), kind="")[-1]["type"] == "stopped"


def test_another_page_interrupts(served, truth):
    with talk_with(served) as first, talk_with(served) as second:
        first.say(type="pick", at=place_on(truth, "road_boundary"), kind="road_boundary")
        first.hear()
        assert (
            second.follow(type="pick", at=place_on(truth, "lane_marking"), kind="")[-1]["type"] == "stopped"
        )
        assert first.hear_all()[-1]["type"] == "stopped"


def test_without_a_session_nothing_is_followed(served):
    from websockets.sync.client import connect

    with (
        pytest.raises(Exception, match=r"4\d\d"),
        connect(f"{served.socket_url}/api/follow", additional_headers={"Origin": served.url}) as socket,
    ):
        socket.send(json.dumps({"type": "interrupt"}))
        with pytest.raises(ConnectionClosed):
            socket.recv(timeout=120)


def test_an_edge_is_followed_from_an_image(talk, served):
    pairs = served.get("/api/pairs")
    number = pairs[2]["number"]
    lines = served.get(f"/api/pairs/{number}/lines")["left"]
    pixels = [px for line in lines if line["kind"] == "lane_marking" for run in line["runs"] for px in run]
    # Beside a line, low in the image: the road before the van
    for at in sorted(pixels, key=lambda px: -px[1]):
        *told, last = talk.follow(type="pick_image", pair=number, side="left", at_px=at, kind="lane_marking")
        if last["type"] == "stopped":
            break
    assert last["type"] == "stopped", last
    seen = [news for news in told if news["type"] == "seen"]
    assert seen[0]["pair"] == number
    nearest = np.hypot(*(np.array(seen[0]["left"]) - at).T).min()
    assert nearest < 30.0
    assert len(seen[0]["left"]) == len(seen[0]["right"])
    assert any(news["type"] == "grown" for news in told)
    assert last["lines"][0]["method"] == "stereo"
