"""MC_SaveAbsoluteEncoderData and what becomes of the data on a new controller (HOM section 2.17)."""

from __future__ import annotations

import json
import os

import pytest

from motion.s7.instructions import MC_SaveAbsoluteEncoderData
from motion.s7.memory_card import FILE, FOLDER, USED
from testcases.unit.motion_axis.conftest import Rig

ABSOLUTE = {"Sensor[1].Type": 1}


@pytest.fixture
def card(tmp_path):
    return tmp_path / "card"


def controller(card=None, **variables):
    """Return a new controller with one axis on an absolute encoder, with a card if there is one."""
    rig = Rig(variables=ABSOLUTE | variables)
    rig.runtime.stop()
    rig.restored = None if card is None else rig.runtime.insert_card(card)
    rig.runtime.start()
    return rig


def adjusted(card, position=123.0):
    """Return a controller whose encoder was adjusted, and that has saved it."""
    rig = controller(card)
    rig.enabled()
    rig.until(rig.axis.home(position, mode=7).done)
    save = MC_SaveAbsoluteEncoderData(rig.runtime)
    rig.runtime.call(save)
    rig.cycles(1)
    save.Execute = True
    rig.cycles(1)
    assert save.Busy
    rig.until(save.done)
    assert not save.Busy
    return rig


def reported(rig, kind):
    return [event.data for event in rig.events(f"controller.encoder_data_{kind}")]


@pytest.mark.requirement("MC-466", "MC-467", "MC-468", "MC-471", "MC-033", "HOM-158", "VAR-207")
def test_saving(card):
    """One file in UserFiles with the adjustment of every absolute encoder; Done is held with Execute."""
    rig = adjusted(card)
    content = json.loads((card / FOLDER / FILE).read_text())
    sensors = content["objects"]["axis1"]["sensors"]
    assert list(sensors) == ["StatusSensor[1]"]
    assert sensors["StatusSensor[1]"]["adjusted"] == 1
    assert len(reported(rig, "saved")) == 1


@pytest.mark.requirement("MC-472", "HOM-159", "HOM-160")
def test_a_new_controller_takes_the_data_over(card):
    """The position is right at once and the axis homed; the file is used up."""
    adjusted(card)
    rig = controller(card)
    assert rig.restored
    rig.cycles(3)
    assert rig.axis.var("ActualPosition") == pytest.approx(123.0, abs=1e-3)
    assert rig.axis.var("StatusSensor[1].Adjusted") == 1
    assert rig.axis.var("StatusWord.X5")
    assert len(reported(rig, "restored")) == 1
    assert not (card / FOLDER / FILE).exists()
    assert (card / FOLDER / USED).exists()
    third = controller(card)
    assert not third.restored
    third.cycles(3)
    assert not third.axis.var("StatusWord.X5")


@pytest.mark.requirement("HOM-159", "HOM-162", "MC-472")
@pytest.mark.parametrize(
    ("variables", "reason"),
    [
        ({"Sensor[1].Parameter.StepsPerRevolution": 4096}, "StepsPerRevolution"),
        ({"Sensor[1].Type": 0}, "Sensor[1].Type"),
        ({"Sensor[1].InverseDirection": True}, "InverseDirection"),
    ],
)
def test_another_encoder_gets_nothing(card, variables, reason):
    """Nothing is restored, the log says what differs, and the file stays."""
    adjusted(card)
    rig = controller(card, **variables)
    assert not rig.restored
    assert reason in reported(rig, "refused")[0]["reason"]
    assert (card / FOLDER / FILE).exists()


@pytest.mark.requirement("HOM-162", "HOM-159")
def test_another_name_or_number_of_objects_gets_nothing(card):
    """Names and number of the technology objects have to be the same."""
    adjusted(card)
    path = card / FOLDER / FILE
    rig = controller()
    rig.axis.object.name = "other"
    assert not rig.runtime.insert_card(card)
    assert "'axis1' does not exist" in reported(rig, "refused")[0]["reason"]
    two = controller()
    second = Rig(variables=ABSOLUTE).axis.object
    second.name = "axis2"
    two.runtime.add(second)
    assert not two.runtime.insert_card(card)
    assert "1 technology objects were saved, there are 2" in reported(two, "refused")[0]["reason"]
    assert path.exists()


@pytest.mark.requirement("MC-607")
@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace('"adjusted": true', '"adjusted": false'),
        lambda text: "[]",
        lambda text: "",
        lambda text: '{"sha256": "0"}',
    ],
)
def test_damaged_data_are_not_used(card, damage):
    """A file that was cut or changed is reported and left alone."""
    adjusted(card)
    path = card / FOLDER / FILE
    path.write_text(damage(path.read_text()))
    rig = controller(card)
    assert not rig.restored
    assert "damaged" in reported(rig, "refused")[0]["reason"]
    rig.cycles(3)
    assert not rig.axis.var("StatusWord.X5")


@pytest.mark.requirement("MC-607", "MC-465", "MC-469", "MC-470", "MC-626", "HOM-204")
@pytest.mark.parametrize(
    ("number", "error"),
    [(28, 0x80EB), (30, 0x80EF), (13, 0x80EF), (5, 0x80EC)],
    ids=["full", "read-only", "no access", "I/O"],
)
def test_what_the_card_refuses(card, monkeypatch, number, error):
    """Full, protected, or broken: each has its ErrorID, and an earlier file stays whole."""
    rig = adjusted(card)
    before = (card / FOLDER / FILE).read_text()
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(number, "no")))
    save = MC_SaveAbsoluteEncoderData(rig.runtime, Execute=True)
    rig.runtime.call(save)
    rig.cycles(3)
    assert (save.Error, save.ErrorID, save.Done) == (True, error, False)
    assert (card / FOLDER / FILE).read_text() == before
    save.Execute = False
    rig.cycles(1)
    assert (save.Error, save.ErrorID) == (False, 0)


@pytest.mark.requirement("MC-626", "HOM-204")
def test_two_instances_and_one_save_at_a_time(card):
    """A second save meanwhile: 16#80EE; a third instance: 16#80ED."""
    rig = controller(card)
    one, two, three = (MC_SaveAbsoluteEncoderData(rig.runtime) for _ in range(3))
    one(Execute=True)
    two(Execute=True)
    three(Execute=True)
    assert one.Busy
    assert two.ErrorID == 0x80EE
    assert three.ErrorID == 0x80ED
    one()
    assert one.Done


def test_without_a_card_nothing_can_be_saved(card):
    """16#80EC."""
    rig = controller()
    save = MC_SaveAbsoluteEncoderData(rig.runtime)
    save(Execute=True)
    assert save.ErrorID == 0x80EC
