"""Tries grbl-streamer with an emulated board."""

import importlib.metadata
import os
import threading
import time

from board import Board, Checks, figure, program, wait_for
from grbl_streamer import GrblStreamer

board, checks = Board(), Checks()
checks.version(importlib.metadata.version("grbl-streamer"))
events = []
grbl = GrblStreamer(lambda *event: events.append(event))
grbl.setup_logging()


def came(name, since=0):
    return [event for event in events[since:] if event[0] == name]


def threads_live():
    return grbl._thread_read_iface.is_alive()


grbl.cnect(board.port, 115200)
checks.check("the board boots after ctrl-X", wait_for(lambda: came("on_boot")), events[-5:])
greeting = [event[1] for event in came("on_read") if event[1].startswith("Grbl ")]
checks.check(
    "the greeting is that of Grbl 1.1", greeting and greeting[0].startswith("Grbl 1.1"), greeting
)
grbl.poll_start()
checks.check("the state is polled", wait_for(lambda: came("on_stateupdate")), events[-5:])
checks.check("it is idle", wait_for(lambda: grbl.cmode == "Idle"), grbl.cmode)
settings = wait_for(lambda: came("on_settings_downloaded"))
checks.check("$$ is read", settings and 110 in grbl.settings, grbl.settings)
checks.check("$# is read to its end", wait_for(lambda: came("on_hash_stateupdate")), events[-5:])
grbl.get_gcode_parser_state()
checks.check(
    "$G is answered",
    wait_for(lambda: any(str(event[1]).startswith("[GC:G") for event in came("on_read"))),
    events[-5:],
)
for line in ["$N", "$C", "$C"]:
    grbl._iface_write(line + "\n")
    time.sleep(0.3)
checks.check("its reading thread lives", threads_live())
grbl.softreset()
time.sleep(0.5)

mark = len(events)
grbl.send_immediately("$J=G91 X20 Y5 F3000")
moved = wait_for(lambda: grbl.cmpos == (20.0, 5.0, 0.0) and grbl.cmode == "Idle")
checks.check("a jog moves, and its position is read", moved, (grbl.cmode, grbl.cmpos))
grbl.send_immediately("G10 L20 P1 X0 Y0")
mark = len(events)
grbl.hash_state_requested = True
shifted = wait_for(lambda: grbl.settings_hash.get("G54", ())[:2] == (20.0, 5.0))
checks.check("the work coordinates are set and read", shifted, grbl.settings_hash)
grbl.send_immediately("G10 L2 P1 X0 Y0")
time.sleep(0.3)


def run(lines, incremental):
    grbl.job_new()
    grbl.incremental_streaming = incremental
    grbl.write("\n".join(lines))
    grbl.job_run()


for incremental, name in ((False, "by counting bytes"), (True, "line by line")):
    board.forget()
    mark = len(events)
    run(program(), incremental)
    done = wait_for(lambda: came("on_job_completed", mark) and grbl.cmode == "Idle", 180)
    refused = came("on_error", mark)
    checks.check(f"a file is streamed {name}", done and not refused, refused)
    time.sleep(1.0)
    wait_for(lambda: grbl.cmode == "Idle" and grbl.cmpos[:2] == (0.0, 0.0))
    difference = board.differs(figure())
    checks.check(f"its ink is the figure, streamed {name}", not difference, difference)

slow = ["G21 G90", "M3", *(f"G1 X{x} F150" for x in (100, 101) * 40), "M5", "M2"]
mark = len(events)
run(slow, False)
checks.check("it runs", wait_for(lambda: grbl.cmode == "Run"), grbl.cmode)
grbl.hold()
checks.check("it holds", wait_for(lambda: str(grbl.cmode).startswith("Hold:0")), grbl.cmode)
stood = grbl.cmpos
time.sleep(1)
checks.check("it stands in the hold", grbl.cmpos == stood, (grbl.cmpos, stood))
grbl.resume()
checks.check("it resumes", wait_for(lambda: grbl.cmode == "Run"), grbl.cmode)
mark = len(events)
grbl.abort()
checks.check("ctrl-X gives the job up", wait_for(lambda: came("on_boot", mark)), events[-5:])
checks.check("it is idle afterwards", wait_for(lambda: grbl.cmode == "Idle"), grbl.cmode)
at = grbl.cmpos
grbl.job_new()
grbl.send_immediately("G0 X5 Y6")
checks.check(
    "the position was kept", wait_for(lambda: grbl.cmpos[:2] == (5.0, 6.0)), (at, grbl.cmpos)
)
mark = len(events)
grbl.send_immediately("G0 X1 X2")
checks.check(
    "an error has Grbl's number",
    wait_for(lambda: [event for event in came("on_error", mark) if event[1] == "error:25"]),
    came("on_error", mark),
)
checks.check("its reading thread still lives", threads_live())
board.end()
# Its threads wait for a port that is gone.
threading.Timer(0, os._exit, [0]).start()
