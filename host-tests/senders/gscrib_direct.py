"""Tries gscrib with an emulated board, by its direct writing to a serial port."""

import importlib.metadata
import os
import select
import threading
import time

from board import Board, Checks, figure, wait_for
from gscrib import GCodeBuilder

board, checks = Board(), Checks()
checks.version(importlib.metadata.version("gscrib"))


def builder():
    return GCodeBuilder(direct_write="serial", port=board.port, baudrate=115200)


def attempt(name, action):
    """Checks that an action ends, and without an error. gscrib waits for an answer for ever."""
    errors = []

    def act():
        try:
            action()
        except Exception as error:
            errors.append(error)

    thread = threading.Thread(target=act, daemon=True)
    thread.start()
    thread.join(60)
    if thread.is_alive():
        errors.append("no answer; the board has heard " + board.heard())
    return checks.check(name, not errors, errors)


def greeting():
    """What the port has for who opens it."""
    file = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
    try:
        return os.read(file, 256) if select.select([file], [], [], 0)[0] else b""
    finally:
        os.close(file)


# The board has greeted before anybody opens the port, as one at a USB port does that does not reset
# when it is opened. gscrib sends `G4 P0` at once and waits for the `ok`, or for a greeting. After a
# greeting it sends nothing more, but still waits for an `ok` without end. So if it opened the port
# while the board still started, the board would lose the line, and gscrib would stand still.
checks.check("the board runs before the port is opened", b"Grbl " in greeting())
machine = builder()
attempt("it connects to a port that does not greet", lambda: machine.set_length_units("mm"))
attempt("the distance mode is set", lambda: machine.set_distance_mode("absolute"))
attempt("the plane is set", lambda: machine.set_plane("xy"))
attempt("the feed mode is set", lambda: machine.set_feed_mode("units/min"))
attempt("the feed is set", lambda: machine.set_feed_rate(3000))
attempt("a rapid move", lambda: machine.rapid(x=5, y=5, z=5))
attempt("G92 sets the axes", lambda: machine.set_axis(x=0, y=0, z=0))
attempt("M8 turns coolant on", lambda: machine.coolant_on("flood"))
attempt("M9 turns coolant off", lambda: machine.coolant_off())
attempt("M7 turns mist on", lambda: machine.coolant_on("mist"))
attempt("mist off", lambda: machine.coolant_off())
machine.write("G4 P0")
attempt("M114 is answered", lambda: machine.query("position"))
position = [machine.get_parameter(axis) for axis in "XYZ"]
checks.check("M114 tells the position", wait_for(lambda: None not in [
    machine.get_parameter(axis) for axis in "XYZ"], 5), position)
attempt("the shift ends", lambda: machine.write("G92.1"))
attempt("a dwell", lambda: machine.sleep(0.1))
attempt("a wait", lambda: machine.wait())
attempt("relative moves", lambda: (machine.set_distance_mode("relative"), machine.move(x=1),
                                   machine.set_distance_mode("absolute")))
# It ends the program, which has shown Z; the next one shows M3 and M5.
machine.write("M2")
attempt("back to the origin", lambda: machine.rapid(x=0, y=0))
machine.write("G4 P0")
board.forget()


def draw():
    for (x, y), *rest in figure():
        machine.rapid(x=x, y=y)
        machine.tool_on("cw", 1000)
        for x, y in rest:
            machine.move(x=x, y=y)
        machine.tool_off()
    machine.rapid(x=0, y=0)
    machine.write("G4 P0.1")


attempt("a figure is sent", draw)
time.sleep(1)
difference = board.differs(figure())
checks.check("its ink is the figure", not difference, difference)
attempt("the program ends", lambda: machine.stop())
attempt("it disconnects", lambda: machine.teardown())
board.end()
os._exit(0)
