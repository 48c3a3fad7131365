"""Whatever looks at a drive in the cycle of the controller finds its motor where it is at that instant."""

from __future__ import annotations

from functools import partial

import pytest

from hil.bench import Bench, load_bench


def note(bench, mechanics, positions):
    positions.append((bench.now_s, mechanics.position))


def looks_in_the_program(bench, look):
    bench.runtime.call(look)


def looks_first_in_the_program(bench, look):
    bench.runtime.call(look, first=True)


def looks_after_the_cycle(bench, look):
    bench.runtime.after_cycle.append(look)


def looks_on_each_cycle(bench, look):
    bench.on_cycle(look)


def looks_at_events_of_the_controller(bench, look):
    axis = bench.axis()
    bench.history.listen(lambda event: look() if event.source == axis.name else None)
    axis.move_relative(0.5)  # takes over from the other job, begins and ends


def orders_in_the_program(bench, look):
    """Give an order to the drive itself, which acts from this instant on."""
    drive = bench.drive()

    def order():
        drive.core.add_torque(0.02 if bench.runtime.cycles % 2 else -0.02)
        look()

    bench.runtime.call(order)


@pytest.mark.parametrize(
    "arrange",
    [
        looks_in_the_program,
        looks_first_in_the_program,
        looks_after_the_cycle,
        looks_on_each_cycle,
        looks_at_events_of_the_controller,
        orders_in_the_program,
    ],
)
def test_the_motor_is_where_it_is(arrange):
    """The positions are those of a bench in which each servo step is an event of its own."""
    seen = []
    for steps_are_events in (False, True):
        with Bench(load_bench("fast").config) as bench:
            axis = bench.axis()
            power = axis.power()
            assert bench.run_until(power.status, 3.0)
            axis.move_velocity(50.0)
            bench.run_for(0.1)
            mechanics = bench.drive().mechanics
            positions = []
            arrange(bench, partial(note, bench, mechanics, positions))
            if steps_are_events:
                bench.scheduler.make_steps_events()
            bench.run_for(0.1)
            assert len(positions) > 2
            seen.append(positions)
    assert seen[0] == seen[1]
