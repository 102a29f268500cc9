"""Tries what vpype writes with each profile of vpype-gcode, sent line by line to an emulated
board."""

import importlib.metadata
import os
import subprocess
import sys

import serial

from board import STEPS, Board, Checks, figure, wait_for

HEIGHT = 80
"""The height of the page in millimetres."""

PROFILES = {
    # Whether y counts downward, and the settings that the profile needs.
    "gcode": (False, []),
    "gcodemm": (False, []),
    "gcode_relative": (False, []),
    "ninja": (True, ["$207=4.5", "$208=1"]),
    "step_motor": (True, ["$208=1"]),
    "step_motor_relative": (True, ["$208=1"]),
}

# The relative profiles round each line, so that a long stroke ends elsewhere than it should.
FIGURE = figure(32)
INCHES = 0.0001 * 25.4 * STEPS
"""How far the profiles in inches round, in steps."""

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


def send(line):
    """Sends a line, and returns its answer."""
    port.write(line.encode() + b"\n")
    while True:
        answer = port.readline().decode().strip()
        if answer == "ok" or answer.startswith("error") or not answer and not port.in_waiting:
            return answer


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
        for line in file:
            answer = send(line.rstrip("\n"))
            # These boards have no switches: Grbl refuses homing while it is off.
            answers.append("ok" if line.startswith("$H") and answer == "error:5" else answer)
    wait_for(is_idle)
    refused = [answer for answer in answers if answer != "ok"]
    checks.check(f"{profile} is accepted", not refused, refused)
    drawn = [[(x, y if downward else HEIGHT - y) for x, y in line] for line in FIGURE]
    rounding = (len(FIGURE[1]) if "relative" in profile else 1) * INCHES / 2
    difference = board.differs(drawn, rounding if profile.startswith("gcode") else 0)
    checks.check(f"the ink of {profile} is the drawing", not difference, difference)
port.close()
board.end()
