"""Tries bCNC with an emulated board: its class `Sender`, which has the serial line, its controllers
and its editor of files, without its window."""

import importlib.metadata
import importlib.util
import os
import sys
import time

package = os.path.dirname(importlib.util.find_spec("bCNC").origin)
for folder in ("controllers", "plugins", "lib", ""):
    sys.path.insert(0, os.path.join(package, folder))
sys.argv, arguments = sys.argv[:1], sys.argv
import Helpers  # noqa: E402, F401 (it installs the translations, which the others need)
import Utils  # noqa: E402

Utils.loadConfiguration()
from CNC import CNC, WAIT  # noqa: E402
from Sender import Sender  # noqa: E402

sys.argv = arguments
from board import Board, Checks, figure, program, wait_for  # noqa: E402

board, checks = Board(), Checks()
checks.version(importlib.metadata.version("bCNC"))


class Machine(Sender):
    """The sender of bCNC, without the window that it is a part of."""

    def disable(self):
        pass

    def event_generate(self, *arguments, **named):
        pass

    def log_lines(self):
        lines = []
        while not self.log.empty():
            lines.append(self.log.get())
        return lines

    def run_lines(self, lines):
        """As `run` in bCNC's main window."""
        CNC.vars["_OvChanged"] = True
        self.initRun()
        self._runLines = sys.maxsize
        self._gcount = 0
        count = 1
        for line in CNC.compile(lines):
            if line is not None:
                self.queue.put(line + "\n" if isinstance(line, str) else line)
                count += 1
        self._runLines = count
        self.queue.put((WAIT,))


machine = Machine()
state = lambda: CNC.vars["state"]  # noqa: E731
place = lambda: (CNC.vars["mx"], CNC.vars["my"])  # noqa: E731


def errors():
    return [line for kind, line in machine.log_lines() if kind == Sender.MSG_ERROR]


checks.check("it opens the port", machine.open(board.port, 115200))
checks.check("it is idle", wait_for(lambda: state() == "Idle"), state())
machine.softReset()
checks.check(
    "it recognises Grbl 1",
    wait_for(lambda: str(CNC.vars["version"]).startswith("1.1")) and machine.controller == "GRBL1",
    CNC.vars["version"],
)
time.sleep(1)
errors()
machine.viewSettings()
checks.check("$$ is read", wait_for(lambda: CNC.vars.get("grbl_132")), CNC.vars.get("grbl_132"))
machine.viewParameters()
checks.check("$# is read", wait_for(lambda: "G92X" in CNC.vars and "PRB" in CNC.vars))
machine.viewState()
checks.check("$G is read", wait_for(lambda: "G54" in CNC.vars["G"]), CNC.vars["G"])
machine.viewBuild()
checks.check("$I is read", wait_for(lambda: "VER" in CNC.vars), "")
machine.viewStartup()
machine.grblHelp()
time.sleep(0.5)
machine.checkGcode()
checks.check("check mode begins", wait_for(lambda: state() == "Check"), state())
machine.checkGcode()
checks.check("check mode ends", wait_for(lambda: state() == "Idle"), state())
time.sleep(1)
refused = errors()
checks.check("none of these is refused", not refused, refused)

machine.mcontrol.jog("X20 Y5")
checks.check("a jog moves", wait_for(lambda: place() == (20.0, 5.0)), place())
machine.mcontrol._wcsSet(0, 0, 0)
checks.check(
    "the work position is set",
    wait_for(lambda: (CNC.vars["wx"], CNC.vars["wcox"]) == (0.0, 20.0)),
    (CNC.vars["wx"], CNC.vars["wcox"]),
)
machine.sendGCode("G10 L2 P1 X0 Y0 Z0")
# Z0 would lower the pen.
machine.goto(3, 4, 5)
checks.check("it goes to a place", wait_for(lambda: place() == (3.0, 4.0)), place())
refused = errors()
checks.check("no line was refused", not refused, refused)

for percent in (130, 87, 100):
    CNC.vars["_OvFeed"] = percent
    CNC.vars["_OvChanged"] = True
    reached = wait_for(lambda: CNC.vars["OvFeed"] == percent, 20)
    checks.check(f"the override of the feed is {percent} %", reached, CNC.vars["OvFeed"])
for percent in (50, 25, 100):
    CNC.vars["_OvRapid"] = percent
    CNC.vars["_OvChanged"] = True
    reached = wait_for(lambda: CNC.vars["OvRapid"] == percent, 20)
    checks.check(f"the override of rapid moves is {percent} %", reached, CNC.vars["OvRapid"])

time.sleep(1)
errors()
board.forget()
machine.run_lines(program())
done = wait_for(lambda: machine._gcount >= machine._runLines, 180)
checks.check("a file is streamed", done, (machine._gcount, machine._runLines, state()))
machine.runEnded()
refused = errors()
checks.check("none of its lines is refused", not refused, refused)
time.sleep(1)
difference = board.differs(figure())
checks.check("its ink is the figure", not difference, difference)

machine.run_lines(["M3", *(f"G1 X{x} F150" for x in (100, 101) * 40), "M5", "M2"])
checks.check("it runs", wait_for(lambda: state() == "Run"), state())
machine.feedHold()
checks.check("it holds", wait_for(lambda: state() == "Hold:0"), state())
stood = place()
time.sleep(1)
checks.check("it stands in the hold", place() == stood, (place(), stood))
machine.resume()
checks.check("it resumes", wait_for(lambda: state() == "Run"), state())
machine.stopRun()
checks.check("it stops", wait_for(lambda: state() == "Idle"), state())
time.sleep(2)
machine._pause = False
refused = [line for line in errors() if "error" in line]
checks.check("what it restores after the stop is accepted", not refused, refused)
stood = place()
machine.sendGCode("G0 X7 Y8")
checks.check("the position was kept", wait_for(lambda: place() == (7.0, 8.0)), (stood, place()))
board.heard()
for byte in ("91", "90"):
    machine.sendHex(byte)
time.sleep(0.5)
checks.check("a byte above 0x7F comes as two of UTF-8", "xc2" in board.heard())
machine.sendGCode("G0 X1 Y1")
checks.check("a line behind it is accepted", wait_for(lambda: place() == (1.0, 1.0)), errors())
machine.thread = None
time.sleep(0.5)
board.end()
os._exit(0)
