"""Tries cncjs with an emulated board: its server, by the socket that its page uses."""

import json
import os
import socket
import subprocess
import time

import socketio

from board import Board, Checks, figure, program, wait_for

board, checks = Board(), Checks()
package = os.path.join(os.environ["PENUP_SENDER"], "node_modules/cncjs")
with open(os.path.join(package, "package.json")) as file:
    checks.version(json.load(file)["version"])

with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    http = free.getsockname()[1]
config = os.path.join(board.folder, "cncrc.json")
with open(config, "w") as file:
    json.dump({"secret": "penup"}, file)
server = subprocess.Popen(
    ["node", os.path.join(package, "bin/cncjs"), "--host", "127.0.0.1", "--port", str(http),
     "--config", config],
    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, "HOME": board.folder},
)


def token():
    """The key of a session, signed as cncjs signs it."""
    import base64
    import hashlib
    import hmac

    with open(config) as file:
        secret = json.load(file)["secret"]

    def coded(data):
        return base64.urlsafe_b64encode(data).rstrip(b"=")

    now = int(time.time())
    parts = [{"alg": "HS256", "typ": "JWT"}, {"id": "", "name": "", "iat": now, "exp": now + 86400}]
    text = b".".join(coded(json.dumps(part).encode()) for part in parts)
    return (text + b"." + coded(hmac.new(secret.encode(), text, hashlib.sha256).digest())).decode()


page = socketio.Client()
read, states, settings, workflow = [], [{}], [{}], ["idle"]
page.on("serialport:read", lambda line: read.append(line))
page.on("Grbl:state", lambda state: states.append(state))
page.on("Grbl:settings", lambda found: settings.append(found))
page.on("workflow:state", lambda state, *rest: workflow.append(state))


def connect():
    try:
        page.connect(f"http://127.0.0.1:{http}/?token={token()}", transports=["websocket"])
        return True
    except Exception:
        time.sleep(0.3)
        return False


def command(*arguments):
    page.emit("command", (board.port, *arguments))


def status(name):
    return states[-1].get("status", {}).get(name)


def state():
    return status("activeState")


def place(name="mpos"):
    found = status(name) or {}
    return tuple(float(found.get(axis, "nan")) for axis in "xy")


def errors(since=0):
    return [line for line in read[since:] if "error" in str(line)]


def send(*lines):
    command("gcode", list(lines))


try:
    checks.check("its server starts", wait_for(connect, 60))
    opened = []
    page.emit("open", (board.port, {"baudrate": 115200, "controllerType": "Grbl"}),
              callback=lambda *answer: opened.append(answer))
    checks.check("it opens the port", wait_for(lambda: opened and not any(opened[0]), 20), opened)
    checks.check("it is idle", wait_for(lambda: state() == "Idle"), state())
    version = lambda: settings[-1].get("version")  # noqa: E731
    # The greeting may have been read before the port was open. It asks for the settings behind it,
    # which a reset would cut off.
    if not wait_for(version, 5):
        command("reset")
    checks.check("it recognises Grbl 1.1", wait_for(lambda: str(version()).startswith("1.1")),
                 version())
    found = lambda: settings[-1].get("settings", {})  # noqa: E731
    checks.check("$$ is read", wait_for(lambda: "$132" in found()), sorted(found()))
    send("$#")
    checks.check("$# is read", wait_for(lambda: "PRB" in settings[-1].get("parameters", {})), "")
    modal = lambda: states[-1].get("parserstate", {}).get("modal", {})  # noqa: E731
    checks.check("$G is read", wait_for(lambda: modal().get("wcs") == "G54"), modal())
    mark = len(read)
    send("$I")
    checks.check("$I is answered", wait_for(lambda: any("[VER:" in line for line in read[mark:])))
    mark = len(read)
    send("$N")
    checks.check("$N is answered", wait_for(lambda: any("$N1=" in line for line in read[mark:])))
    mark = len(read)
    send("$")
    checks.check("$ is answered", wait_for(lambda: any("[HLP:" in line for line in read[mark:])))
    checks.check("none of these is refused", not errors(), errors())

    send("$J=G91 X20 Y5 F3000")
    checks.check("a jog moves", wait_for(lambda: place() == (20.0, 5.0)), place())
    wait_for(lambda: state() == "Idle")
    send("G10 L20 P1 X0 Y0")
    checks.check("the work position is read", wait_for(lambda: place("wpos") == (0.0, 0.0)),
                 place("wpos"))
    send("G10 L2 P1 X0 Y0")
    send("G92 X1 Y2")
    checks.check("G92 shifts it", wait_for(lambda: place("wpos") == (1.0, 2.0)), place("wpos"))
    send("G92.1")
    send("G55")
    checks.check("G55 is seen", wait_for(lambda: modal().get("wcs") == "G55"), modal())
    send("G54")
    send("G0 X0 Y0")
    checks.check("it goes back", wait_for(lambda: place() == (0.0, 0.0)), place())
    send("M3 S500")
    checks.check("M3 and S are seen", wait_for(lambda: modal().get("spindle") == "M3" and
                 float(status("spindle") or 0) == 500), (modal(), status("spindle")))
    send("M5")
    checks.check("no line was refused", not errors(), errors())

    ov = lambda: [int(part) for part in status("ov") or []]  # noqa: E731
    for name, value, expected in (
        ("feedOverride", 10, [110, 100]), ("feedOverride", -1, [109, 100]),
        ("feedOverride", 0, [100, 100]), ("rapidOverride", 50, [100, 50]),
        ("rapidOverride", 100, [100, 100]),
    ):
        board.heard()
        command(name, value)
        came = wait_for(lambda: ov()[:2] == expected, 10)
        checks.check(f"{name} {value} is reported", came, ov())
    checks.check("it sends such a byte as two of UTF-8, or as itself", "x9" in board.heard())
    command("spindleOverride", 10)
    send("G0 X1 Y1")
    checks.check("a line behind the override of S is accepted",
                 wait_for(lambda: place() == (1.0, 1.0)) and not errors(), errors())

    board.forget()
    mark = len(read)
    page.emit("command", (board.port, "gcode:load", "figure.gcode", "\n".join(program()), {}))
    time.sleep(0.5)
    command("gcode:start")
    checks.check("a file is streamed", wait_for(lambda: workflow[-1] == "idle" and "running" in
                 workflow and state() == "Idle", 180), (workflow, state()))
    checks.check("none of its lines is refused", not errors(mark), errors(mark))
    time.sleep(1)
    difference = board.differs(figure())
    checks.check("its ink is the figure", not difference, difference)
    checks.check("it is back at the origin", wait_for(lambda: place() == (0.0, 0.0)), place())

    # Emulated time may run much faster than this program.
    slow = ["M3", *(f"G1 X{x} F150" for x in (100, 101) * 400), "M5", "M2"]
    page.emit("command", (board.port, "gcode:load", "slow.gcode", "\n".join(slow), {}))
    time.sleep(0.5)
    command("gcode:start")
    checks.check("it runs", wait_for(lambda: state() == "Run"), state())
    command("gcode:pause")
    checks.check("it holds", wait_for(lambda: state() == "Hold" and status("subState") == 0),
                 (state(), status("subState")))
    stood = place()
    time.sleep(1)
    checks.check("it stands in the hold", place() == stood, (place(), stood))
    command("gcode:resume")
    checks.check("it resumes", wait_for(lambda: state() == "Run"), state())
    command("gcode:pause")
    wait_for(lambda: state() == "Hold")
    mark = len(read)
    command("gcode:stop", {"force": True})
    checks.check("a stop by force gives it up",
                 wait_for(lambda: any(str(line).startswith("Grbl") for line in read[mark:])),
                 read[mark:])
    checks.check("it is idle afterwards", wait_for(lambda: state() == "Idle"), state())
    checks.check("there is no alarm", not any("ALARM" in str(line) for line in read), read[mark:])
    send("G0 X7 Y8")
    checks.check("the position was kept", wait_for(lambda: place() == (7.0, 8.0)), place())
    mark = len(read)
    send("$J=X200 F150")
    wait_for(lambda: state() == "Jog")
    command("jogCancel")
    checks.check("a jog is cancelled", wait_for(lambda: state() == "Idle") and place()[0] < 200,
                 place())
    mark = len(read)
    send("G0 X1 X2")
    checks.check("an error has Grbl's number", wait_for(lambda: any("error:25" in line for line in
                 errors(mark))), errors(mark))
    command("homing")
    checks.check("homing that is off is error:5",
                 wait_for(lambda: any("error:5 " in line for line in errors(mark))), errors(mark))
    command("unlock")
    command("sleep")
    checks.check("it sleeps", wait_for(lambda: state() == "Sleep"), state())
    command("reset")
    checks.check("ctrl-X wakes it", wait_for(lambda: state() == "Idle"), state())
finally:
    server.terminate()
    server.wait(10)
    board.end()
os._exit(0)
