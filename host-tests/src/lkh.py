"""Finds the shortest way through strokes by LKH (K. Helsgaun), as elkai has it.

Reads the strokes, a line "x y x y" each, and prints the length of the moves between them on an
open path, in the units of the coordinates. Whatever is no stroke costs much more, so that every
stroke is part of the way; a point far from everything joins both ends of the path.
"""

import math
import sys

import elkai

numbers = [[int(word) for word in line.split()] for line in sys.stdin]
points = [point for x, y, u, v in numbers for point in ((x, y), (u, v))]
count = len(points)
far = 100_000
costs = [[0 if i == j else far for j in range(count + 1)] for i in range(count + 1)]
for i, p in enumerate(points):
    for j, q in enumerate(points):
        costs[i][j] = 0 if i // 2 == j // 2 else far + round(math.dist(p, q))
tour = elkai.DistanceMatrix(costs).solve_tsp(runs=1)
moves = [(i, j) for i, j in zip(tour, tour[1:]) if i < count and j < count]
strokes = sum(i // 2 == j // 2 for i, j in moves)
if strokes != len(numbers):
    sys.exit(f"LKH drew {strokes} of {len(numbers)} strokes")
print(sum(math.dist(points[i], points[j]) for i, j in moves if i // 2 != j // 2))
