"""What the scripts beside this one share: the emulated board at a pseudo-terminal, a program to
draw with its figure, and the list of checks.

A script is called with the program that serves the board, the name of the board, and a folder for
its files. It prints `pass` or `fail` for each check, and the version of the program that it tries.
"""

import math
import os
import re
import subprocess
import sys
import time

STEPS = 80
"""Steps per millimetre of the board's default settings."""


class Board:
    """An emulated board, which ends with this process."""

    def __init__(self):
        self.server = subprocess.Popen(
            sys.argv[1:3], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.port = self.server.stdout.readline().strip()
        if not self.port:
            sys.exit("the emulated board does not start")
        self.folder = sys.argv[3]

    def ask(self, order):
        self.server.stdin.write(order + "\n")
        self.server.stdin.flush()
        return self.server.stdout.readline().strip()

    def forget(self):
        """Forgets the ink so far."""
        self.ask("forget")

    def differs(self, polylines):
        """What differs between the ink and polylines in millimetres; nothing if it is the same. The
        last moves may still be on their way when the machine says that it is idle.

        Both ends of a line are rounded to a step, and so is each point between them: together that
        is at most 1.07 steps across it."""
        path = os.path.join(self.folder, "figure.txt")
        with open(path, "w") as file:
            for line in polylines:
                file.write(" ".join(f"{x * STEPS},{y * STEPS}" for x, y in line) + "\n")
        for _ in range(20):
            answer = self.ask(f"judge 0.07 {path}")
            if answer == "same":
                return ""
            time.sleep(0.5)
        return answer

    def heard(self):
        """What the program has sent since the last call, with its other bytes escaped."""
        return self.ask("heard")

    def end(self):
        self.server.stdin.close()
        self.server.wait(20)


def figure(lines=240):
    """A square, and a spiral of many short lines, in millimetres."""
    square = [(10, 10), (40, 10), (40, 30), (10, 30), (10, 10)]
    spiral = []
    for number in range(lines + 1):
        angle, radius = number * 8 * math.pi / lines, 2 + 12 * number / lines
        x, y = 60 + radius * math.cos(angle), 40 + radius * math.sin(angle)
        spiral.append((round(x, 3), round(y, 3)))
    return [square, spiral]


def program():
    """The lines of G-code that draw the figure."""
    lines = ["G21 G90", "F3000"]
    for (x, y), *rest in figure():
        lines += [f"G0 X{x} Y{y}", "M3 S1000"]
        lines += [f"G1 X{x} Y{y}" for x, y in rest]
        lines.append("M5")
    return lines + ["G0 X0 Y0", "M2"]


def wait_for(condition, seconds=60):
    """Waits until the condition is true, and returns whether it is."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.02)
    return bool(condition())


class Checks:
    """Prints what passes and what fails."""

    def version(self, version):
        print(f"version {version}", flush=True)

    def check(self, name, passes, said=""):
        reason = "" if passes else " " + re.sub(r"\s+", " ", str(said))[:300]
        result = "pass " if passes else "fail "
        print(result + name + (": " + reason if reason else ""), flush=True)
        return bool(passes)
