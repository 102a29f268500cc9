"""Orders strokes by vpype: `vpype_sort.py FILE COMMAND`.

FILE has a stroke in each line, as numbers x y x y ...; COMMAND is what vpype does with them, such
as `linesort`. The script prints `ready` when they are in memory. Then it orders them once for each
line of its standard input, and prints the milliseconds of processor time and the length of the
moves between them.
"""

import sys
import time

import numpy
import vpype
import vpype_cli


def main():
    path, command = sys.argv[1:]
    strokes = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            numbers = numpy.array(line.split(), dtype=float)
            strokes.append(numbers[::2] + 1j * numbers[1::2])
    print("ready", flush=True)
    for _ in sys.stdin:
        document = vpype.Document()
        document.add(vpype.LineCollection(strokes), 1)
        began = time.thread_time()
        document = vpype_cli.execute(command, document)
        milliseconds = 1000 * (time.thread_time() - began)
        ordered = list(document.layers[1])
        assert len(ordered) == len(strokes)
        between = sum(abs(b[0] - a[-1]) for a, b in zip(ordered, ordered[1:]))
        print(milliseconds, between, flush=True)


main()
