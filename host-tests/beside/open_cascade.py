"""Finds hidden lines by Open CASCADE: `open_cascade.py FILE EYE AT`.

FILE is an OBJ file of flat faces; EYE and AT are three numbers with commas between them. The script
prints `ready` when the solid is in memory. Then it finds the visible lines once for each line of
its standard input, and prints the milliseconds of processor time and the length of
these lines.

The projection is a parallel one: in perspective, this algorithm also draws faces that only their
distance from the eye turns away from it.
"""

import sys
import time

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeVertex,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.HLRAlgo import HLRAlgo_Projector
from OCP.HLRBRep import HLRBRep_PolyAlgo, HLRBRep_PolyHLRToShape
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Shell
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt


def read(path):
    """The solid as one shell, in which faces share their edges and the edges their vertices."""
    vertices, edges = [], {}
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    with open(path, encoding="utf-8") as file:
        for words in map(str.split, file):
            if words[0] == "v":
                point = gp_Pnt(*map(float, words[1:4]))
                vertices.append(BRepBuilderAPI_MakeVertex(point).Vertex())
            elif words[0] == "f":
                corners = [int(word) - 1 for word in words[1:]]
                wire = BRepBuilderAPI_MakeWire()
                for ends in zip(corners, corners[1:] + corners[:1]):
                    key = (min(ends), max(ends))
                    if key not in edges:
                        begin, end = (vertices[number] for number in key)
                        edges[key] = BRepBuilderAPI_MakeEdge(begin, end).Edge()
                    wire.Add(edges[key])
                face = BRepBuilderAPI_MakeFace(wire.Wire(), True)
                builder.Add(shell, face.Face())
    # All faces are flat, so the accuracy does not matter.
    BRepMesh_IncrementalMesh(shell, 0.1)
    return shell


def vertex_of(shape):
    """The shape as a vertex, by whichever name this version has for that."""
    cast = getattr(TopoDS, "Vertex_s", None) or getattr(TopoDS, "Vertex", None)
    return cast(shape) if cast else shape


def length(compound):
    """The length of all edges, which are straight."""
    total, edges = 0.0, TopExp_Explorer(compound, TopAbs_EDGE)
    while edges.More():
        ends, points = TopExp_Explorer(edges.Current(), TopAbs_VERTEX), []
        while ends.More():
            points.append(BRep_Tool.Pnt_s(vertex_of(ends.Current())))
            ends.Next()
        if len(points) == 2:
            total += points[0].Distance(points[1])
        edges.Next()
    return total


def main():
    path, eye, at = sys.argv[1:]
    eye, at = ([float(number) for number in point.split(",")] for point in (eye, at))
    towards_eye = [a - b for a, b in zip(eye, at)]
    projector = HLRAlgo_Projector(gp_Ax2(gp_Pnt(*at), gp_Dir(*towards_eye)))
    shell = read(path)
    print("ready", flush=True)
    ink = None
    for _ in sys.stdin:
        began = time.thread_time()
        algorithm = HLRBRep_PolyAlgo()
        algorithm.Projector(projector)
        algorithm.Load(shell)
        algorithm.Update()
        # This asks for each edge what hides it. Its lines become shapes only when they are wanted.
        found = HLRBRep_PolyHLRToShape()
        found.Update(algorithm)
        milliseconds = 1000 * (time.thread_time() - began)
        if ink is None:
            kinds = found.VCompound(), found.OutLineVCompound()
            ink = sum(length(kind) for kind in kinds if kind is not None and not kind.IsNull())
        print(milliseconds, ink, flush=True)


main()
