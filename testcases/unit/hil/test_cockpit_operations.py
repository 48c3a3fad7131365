"""The cockpit over its WebSocket: faults, buses, objects of nodes, and the session that becomes a test."""

import pytest

from hil._commands._moment import bench_at_moment
from hil.campaign import Token, load_bench_file
from hil.cockpit.bus_view import BusView
from hil.cockpit.fault_catalogue import describe
from hil.errors import TokenError
from testcases.cockpit_rig import served
from testcases.unit.hil.test_cockpit_written_test import call

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def operator(tmp_path_factory):
    """A page in control of the reference bench, and the working folder."""
    folder = tmp_path_factory.mktemp("work")
    with served(folder=folder) as cockpit, cockpit.page() as one:
        one.live()
        one.do("control.take")
        one.folder = folder
        yield one


def ended(one, count):
    """Return what came of SDO transfers."""
    one.until(lambda: len(one.documents) >= count, "transfers end")
    return [(entry["ok"], entry["wrote"], entry["text"]) for entry in one.documents]


def test_a_session_is_recorded_and_becomes_a_test(operator):
    """What the panel did, a fault with a trigger, and objects that were written are steps; the test that is
    written of them is green.
    """
    operator.do("time.run", speed="max")
    axis = lambda: operator.state["axis"]["axis1"]  # noqa: E731 - the state changes
    operator.command("axis1", "take")
    operator.command("axis1", "enable")
    operator.until(lambda: axis()["enabled"], "enabled")
    operator.command("axis1", "set", 0.0)
    operator.until(lambda: axis()["homed"], "homed")
    operator.command("axis1", "velocity", 200.0)
    operator.do(
        "faults.arm",
        fault="drive.fault",
        target="drive1",
        parameters={"code": 0x2310},
        trigger={"when": "position", "value": 50.0, "direction": "rising"},
    )
    assert operator.refused("faults.arm", fault="drive.fault", parameters={"cod": 1}).startswith(
        "drive.fault"
    )
    assert "can0" in operator.refused("faults.arm", fault="frame.drop", target="can9", parameters={})
    operator.command("axis1", "rel", 400.0)
    operator.until(lambda: axis()["alarms"], "the drive trips")
    operator.until(lambda: axis()["velocity"] == 0.0, "at rest")
    (armed,) = operator.state["faults"]
    assert (armed["stands"], armed["applications"], armed["target"]) == ("over", 1, "drive1")
    operator.command("axis1", "ack")
    operator.until(lambda: not axis()["alarms"], "acknowledged")
    number = operator.do("faults.arm", fault="switch.press", parameters={"input": "positive_limit"})
    operator.until(lambda: operator.state["faults"][0]["stands"] == "active", "pressed")
    operator.do("faults.take_back", number=number)
    operator.do("time.pause")
    texts = [step["text"] for step in operator.do("session.steps")]
    assert texts[0].startswith("axis1: power")
    assert any(text.startswith("axis1: move relative distance = 400.0, Velocity = 200.0") for text in texts)
    assert operator.do("session.hold") == 8
    written = operator.do("session.write", form="pytest", name="trip")
    call(written["text"])
    assert 'trigger=position(50.0, direction="rising")' in written["text"]
    assert "alarm(421, reaction=4, since=hit" in written["text"]
    path = operator.do("session.save", name="trip")
    assert (operator.folder / "test_trip.py").read_text() == written["text"]
    assert path.endswith("test_trip.py")
    assert "is no case of a matrix" in operator.refused("session.write", form="matrix", name="trip")


def test_jogging_the_slider_and_stops_become_a_test(operator):
    """A jog ends when its key is let go, a slider that is moved is the override until the next job, and
    STOP is a halt with the greatest deceleration: the test does the same, and is green.
    """
    operator.do("bench.reset")
    operator.do("time.run", speed=5.0)
    axis = lambda: operator.state["axis"]["axis1"]  # noqa: E731 - the state changes
    operator.until(lambda: operator.state["time_s"] < 1.0 and axis()["master"] == "program", "reset")
    operator.command("axis1", "take")
    operator.command("axis1", "enable")
    operator.until(lambda: axis()["enabled"], "enabled")
    operator.command("axis1", "set", 0.0)
    operator.until(lambda: axis()["homed"], "homed")
    operator.do("axis.jog", axis="axis1", slider=50.0)
    operator.until(lambda: axis()["velocity"] > 20.0, "jogs")
    operator.do("axis.jog", axis="axis1", slider=0.0)
    operator.until(lambda: axis()["velocity"] == 0.0, "let go")
    operator.command("axis1", "rel", 400.0)
    operator.until(lambda: axis()["velocity"] > 40.0, "moves")
    operator.command("axis1", "slide", 50.0)
    operator.do("axis.stop_all")
    operator.until(lambda: axis()["velocity"] == 0.0, "stopped")
    operator.command("axis1", "abs", 5.0)
    operator.until(lambda: abs(axis()["position"] - 5.0) < 0.01 and axis()["velocity"] == 0.0, "there")
    operator.do("session.hold")
    text = operator.do("session.write", form="pytest", name="by hand")["text"]
    call(text)
    for line in (
        "jogging.set(JogForward=False, JogBackward=False)",
        'axis.write("Override.Velocity", 50.0)',
        "axis.halt(Deceleration=2000.0, Jerk=20000.0)",
        'axis.write("Override.Velocity", 100.0)',
        'value_at("axis1.actual_position", bench.now_s, 5.0, tolerance=',
    ):
        assert line in text


def test_frames_objects_and_what_is_refused(operator):
    """Frames are filtered and shown bit by bit; an object is read and written by SDO, and what its EDS does
    not allow is refused before it is sent.
    """
    operator.documents.clear()
    operator.do("bench.reset")
    operator.do("time.run", speed="max")
    operator.until(lambda: operator.state["time_s"] > 0.5, "time passes")
    found = operator.do("bus.frames", segment="can0", words="tpdo1 drive1", most=5)
    assert [row["id"] for row in found["rows"]] == ["185"] * 5
    assert (
        operator.do("bus.frames", segment="can0", since=found["next"])["rows"][0]["number"] >= found["next"]
    )
    quiet = operator.do("bus.frames", segment="can0", cyclic=False)["rows"]
    assert not [row for row in quiet if row["text"].startswith(("SYNC", "TPDO", "RPDO"))]
    details = operator.do("bus.frame", segment="can0", number=found["rows"][0]["number"])
    word = details["fields"][0]
    assert (word["name"], word["object"], word["first"], word["bits"]) == ("Statusword", "6041h:00h", 0, 16)
    assert word["names"]["3"] == "fault"
    assert int(word["hex"][:-1], 16) == sum(1 << bit for bit in word["set"])
    objects = {(one["index"], one["sub"]): one for one in operator.do("bus.objects", node="drive1")}
    assert objects[0x6040, 0]["access"] == "rw"
    assert objects[0x1000, 0]["access"] == "r"
    operator.do("bus.read", node="drive1", index=0x1018, sub=0)
    operator.do("bus.write", node="drive1", index=0x6065, sub=0, value="0x1000")
    assert ended(operator, 2) == [(True, False, "4"), (True, True, "4096")]
    for index, value, said in (
        (0x6065, "-1", "a whole number 0 to 4294967295"),
        (0x6065, "much", "a whole number"),
        (0x1000, "1", "read-only"),
        (0x2FFF, "1", "an object of the EDS"),
    ):
        assert said in operator.refused("bus.write", node="drive1", index=index, value=value)
    assert "one of can0" in operator.refused("bus.frames", segment="can7")
    assert operator.do("session.steps")[-1]["text"] == "drive1: 6065h.00h = 00 10 00 00"


def test_parameters_of_a_drive_on_modbus():
    """They are listed with type and limits, read and written over the bus by data record 47, refused where a
    limit says so before anything is sent, and a written one is a line of the test; a drive whose register map
    has no such channel says so.
    """
    with served("profidrive_tcp") as cockpit, cockpit.page() as one:
        one.live()
        one.do("control.take")
        one.do("time.run", speed=5.0)
        (node,) = one.description["panes"]["bus"]["nodes"]
        assert node == {"name": "drive1", "reason": "", "by": "data record 47"}
        rows = {row["object"]: row for row in one.do("bus.objects", node="drive1")}
        ramp = rows["p1120"]
        assert (ramp["access"], ramp["type"], ramp["low"]) == ("rw", "FLOAT32", 0.0)
        assert rows["r0002"]["access"] == "r"
        one.until(lambda: one.state["time_s"] > 1.0, "the drive is there")
        one.do("bus.write", node="drive1", index=1120, sub=0, value="2.5")
        one.do("bus.read", node="drive1", index=1120, sub=0)
        assert ended(one, 2) == [(True, True, "2.5 s"), (True, False, "2.5 s")]
        assert "a number 0 to" in one.refused("bus.write", node="drive1", index=1120, sub=0, value="-1")
        assert "read-only" in one.refused("bus.write", node="drive1", index=2, sub=0, value="1")
        assert "a parameter of drive1" in one.refused("bus.read", node="drive1", index=4, sub=0)
        one.do("session.hold")
        text = one.do("session.write", form="pytest", name="ramp")["text"]
        line = 'bench.port("drive1").write_parameter(1120, 0, TypeCode.FLOAT32, 2.5)'
        assert f"\n    {line}\n" in text
        call(text, "profidrive_tcp")


def test_a_changed_bench_is_saved_with_its_test(operator):
    """The test of a bench whose text was changed names a file of its own, which is saved next to it."""
    text = load_bench_file("reference").text
    operator.do("bench.start_text", text=f"{text}\n[tolerance]\ntime_s = 0.02\n")
    operator.until(lambda: operator.state["session"]["count"] == 0, "a new session")
    operator.do("time.run", speed="max")
    operator.do("faults.arm", fault="drive.warning", target="drive1", parameters={})
    operator.until(lambda: operator.state["time_s"] > 0.3, "time passes")
    operator.do("session.hold")
    written = operator.do("session.write", form="pytest", name="warm")
    assert '@pytest.mark.hil_bench("warm.toml")' in written["text"]
    operator.do("session.save", name="warm")
    assert "time_s = 0.02" in (operator.folder / "warm.toml").read_text()
    assert (operator.folder / "test_warm.py").exists()


@pytest.mark.parametrize("name", ["reference", "profidrive_tcp"])
def test_the_catalogue_says_what_a_bench_cannot_do(name):
    """Every kind of fault has targets that it can hit here, or the reason why it cannot; nothing is left
    behind on the bench.
    """
    with load_bench_file(name).build(seed=0) as bench:
        found = {one["name"]: one for one in describe(bench)}
        assert not [event for event in bench.history.events if event.kind.startswith("fault.")]
    assert all(bool(one["targets"]) != bool(one["reason"]) for one in found.values())
    modbus = name == "profidrive_tcp"
    assert bool(found["can.bus_off" if "can.bus_off" in found else "frame.drop"]["reason"]) is modbus
    assert found["drive.fault"]["targets"] == ["drive1"]
    assert found["drive.fault"]["parameters"][0]["allowed"].startswith("a whole number")


def test_words_of_a_telegram_have_their_bits():
    """Process data of a PROFIdrive drive are shown signal by signal, with the names of the bits of ZSW1."""
    with load_bench_file("profidrive").build(seed=0) as bench:
        bench.run_for(0.05)
        view = BusView(bench)
        (row,) = view.rows("can0", -1, words="tpdo1 zsw1", most=1)["rows"]
        fields = {one["name"]: one for one in view.details("can0", row["number"])["fields"]}
    assert fields["ZSW1"]["names"]["3"] == "fault"
    assert len(fields["ZSW1"]["set"]) == int(fields["ZSW1"]["hex"][:-1], 16).bit_count()


def test_a_case_is_opened_at_its_time():
    """The bench of a token stands at the instant, in the middle of the motion, and goes on from there; its
    session becomes a test only after a reset. The stop of an operator who has gone is a step, too.
    """
    token = Token("stop-modes/power-0/constant", seed=1, campaign="testcases.campaigns.stop_modes:CAMPAIGN")
    with served(first=lambda: bench_at_moment(token, at_s=0.4)[0]) as cockpit, cockpit.page() as one:
        one.live()
        one.do("control.take")
        one.until(lambda: one.state["time_s"] == 0.4, "it stands there")
        assert one.state["axis"]["axis1"]["state"] == "motion"
        assert one.do("bus.frames", segment="can0")["next"] > 300
        assert "in the middle of a case" in one.refused("session.hold")
        one.do("time.run", speed="max")
        one.until(lambda: one.state["time_s"] > 1.0, "time goes on")
        one.do("bench.reset")
        assert one.do("session.hold") == 0
        one.command("axis1", "take")
        one.command("axis1", "enable")
        one.until(lambda: one.state["axis"]["axis1"]["enabled"], "enabled")
        one.command("axis1", "rel", 300.0)
        one.until(lambda: one.state["axis"]["axis1"]["velocity"] > 0.0, "moves")
        one.hush()
        one.until(lambda: one.do("session.steps")[-1]["text"].startswith("axis1: halt"), "stopped, and noted")
    with pytest.raises(TokenError, match="closes its bench by itself"):
        bench_at_moment(Token("test_a.py::test_b", seed=1, campaign="pytest:test_a.py"))
