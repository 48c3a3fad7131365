"""Whatever looks at a drive in the cycle of the controller finds its motor where it is at that instant."""

from __future__ import annotations

from functools import partial

import pytest

from hil.bench import Bench, load_bench
from hil.bench.makes import with_nc_axes


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


def looks_in_the_program_of_an_nc(bench, look):
    bench.nc.call(look)


def looks_after_the_cycle_of_an_nc(bench, look):
    bench.nc.after_cycle.append(look)


def looks_by_commands_to_an_nc(bench, look):
    """Such a command is executed in the cycle, and gives the next one here."""

    def command():
        look()
        bench.nc.post(command)

    bench.nc.post(command)


def looks_at_events_of_an_nc(bench, look):
    axis = bench.axis()
    bench.history.listen(lambda event: look() if event.source == axis.name else None)
    axis.move_relative(0.5)


S7 = [
    looks_in_the_program,
    looks_first_in_the_program,
    looks_after_the_cycle,
    looks_on_each_cycle,
    looks_at_events_of_the_controller,
    orders_in_the_program,
]
NC = [
    looks_in_the_program_of_an_nc,
    looks_after_the_cycle_of_an_nc,
    looks_by_commands_to_an_nc,
    looks_at_events_of_an_nc,
]


@pytest.mark.parametrize("arrange", [*S7, *NC])
def test_the_motor_is_where_it_is(arrange):
    """The positions are those of a bench in which each servo step is an event of its own."""
    file = load_bench("fast")
    if arrange in NC:
        file = with_nc_axes(file, "fast")
    seen = []
    for steps_are_events in (False, True):
        with Bench(file.config) as bench:
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
            assert positions
            seen.append(positions)
    assert seen[0] == seen[1]
