"""Tries what vpype writes with each profile of vpype-gcode, sent to an emulated board as senders
for Grbl do."""

import importlib.metadata
import os
import re
import subprocess
import sys

import serial

from board import Board, Checks, figure, wait_for

HEIGHT = 80
"""The height of the page in millimetres."""

BUFFER = 128
"""The bytes that Grbl's receive buffer holds."""

DIGIT = 0.0001
"""The last digit that every profile writes."""
INCH = 25.4
SCALE = 25.4 * 0.0393701 - 1
"""How much larger vpype reads a drawing: svgelements takes 0.0393701 inches for a millimetre."""

PROFILES = {
    # Whether y counts downward, and the settings that the profile needs.
    "gcode": (False, []),
    "gcodemm": (False, []),
    "gcode_relative": (False, []),
    "ninja": (True, ["$207=4.5", "$208=1"]),
    "step_motor": (True, ["$208=1"]),
    "step_motor_relative": (True, ["$208=1"]),
}
FIGURE = figure()


def shaped(points):
    """Points as polylines with as many points as those of the figure have."""
    points = iter(points)
    return [[next(points) for _ in line] for line in FIGURE]


def points_of(path):
    """The points in millimetres to which the lines of a file go, and how far vpype may have rounded
    each along an axis: by half its last digit, and by that much again in each relative line,
    because it rounds the lines and not their sum."""
    (x, y), unit, relative = (0, 0), 1, False
    points, roundings = [], []
    with open(path) as file:
        for line in file:
            words = re.findall("([A-Z])([-+.0-9]+)", re.sub(r"[(].*?[)]", "", line))
            modes = [float(number) for letter, number in words if letter == "G"]
            unit = INCH if 20 in modes else 1 if 21 in modes else unit
            relative = 91 in modes or relative and 90 not in modes
            to = {letter: float(number) * unit for letter, number in words}
            if "X" in to:
                x, y = (x + to["X"], y + to["Y"]) if relative else (to["X"], to["Y"])
                points.append((x, y))
                lines = len(points) if relative else 1
                roundings.append(lines * DIGIT * unit / 2)
    return points, roundings


board, checks = Board(), Checks()
checks.version(
    importlib.metadata.version("vpype") + " and " + importlib.metadata.version("vpype-gcode")
)
svg = os.path.join(board.folder, "figure.svg")
with open(svg, "w") as file:
    file.write('<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="80mm" '
               'viewBox="0 0 100 80">\n')
    for line in FIGURE:
        points = " ".join(f"{x},{y}" for x, y in line)
        file.write(f'<polyline fill="none" stroke="black" points="{points}"/>\n')
    file.write("</svg>\n")

port = serial.Serial(board.port, 115200, timeout=120)
port.write(b"\x18")
wait_for(lambda: port.readline().startswith(b"Grbl"), 20)


def answer():
    """The next answer to a line. Other lines may come before it: the greeting behind `$RST=$`
    begins with an empty one."""
    while True:
        received = port.readline()
        text = received.decode().strip()
        if not received:
            sys.exit("a line is not answered")
        if text == "ok" or text.startswith("error"):
            return text


def send(line):
    """Sends a line, and returns its answer."""
    port.write(line.encode() + b"\n")
    return answer()


def stream(lines):
    """Sends lines as senders for Grbl do, as many before the answers as its buffer holds, and
    yields each line with its answer."""
    waiting = []
    for line in lines:
        while waiting and sum(map(len, waiting)) + len(waiting) + len(line) >= BUFFER:
            yield waiting.pop(0), answer()
        port.write(line.encode() + b"\n")
        waiting.append(line)
    for line in waiting:
        yield line, answer()


def is_idle():
    port.write(b"?")
    return port.readline().startswith(b"<Idle")


vpype = os.path.join(os.path.dirname(sys.executable), "vpype")
for profile, (downward, settings) in PROFILES.items():
    written = os.path.join(board.folder, profile + ".gcode")
    made = subprocess.run([vpype, "read", svg, "gwrite", "--profile", profile, written],
                          capture_output=True, text=True)
    if not checks.check(f"{profile} is written", made.returncode == 0 and os.path.exists(written),
                        made.stderr[-200:]):
        continue
    answers = [send(line) for line in ["$RST=$", "$X", "G54", "G92.1", "G90", "G0 X0 Y0"]]
    wait_for(is_idle)
    answers += [send(line) for line in settings]
    board.forget()
    with open(written) as file:
        # These boards have no switches: Grbl refuses homing while it is off.
        answers += ["ok" if line.startswith("$H") and said == "error:5" else said
                    for line, said in stream(line.rstrip("\n") for line in file)]
    wait_for(is_idle)
    refused = [said for said in answers if said != "ok"]
    checks.check(f"{profile} is accepted", not refused, refused)
    # The ink is judged by what vpype has written, so that its rounding excuses nothing of ours.
    points, roundings = points_of(written)
    drawn = [(x, y if downward else HEIGHT - y) for line in FIGURE for x, y in line]
    beside = [max(abs(x - at_x), abs(y - at_y)) - max(at_x, at_y, HEIGHT) * SCALE - rounding
              for (x, y), (at_x, at_y), rounding in zip(points, drawn, roundings)]
    # What remains is the rounding of floating point, which lies far below a digit.
    checks.check(f"{profile} writes the drawing",
                 len(points) >= len(drawn) and max(beside) < DIGIT / 1000, beside)
    difference = board.differs(shaped(points))
    checks.check(f"the ink of {profile} is what it writes", not difference, difference)
port.close()
board.end()
