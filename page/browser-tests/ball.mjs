// A ball as a model, for tests and measurements of large ones.

/** The point of a ball at these angles. */
const point = (a, b) => [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];

/** The OBJ file of a ball of `rings` times `rings` quads. */
export function ball(rings) {
  const lines = [];
  for (let i = 0; i <= rings; i++) {
    for (let j = 0; j < rings; j++) {
      const [a, b] = [((i + 0.02) / (rings + 0.04)) * Math.PI, (j / rings) * 2 * Math.PI];
      lines.push(["v", ...point(a, b).map((c) => c.toFixed(6))].join(" "));
    }
  }
  const vertex = (i, j) => i * rings + (j % rings) + 1;
  for (let i = 0; i < rings; i++) {
    for (let j = 0; j < rings; j++)
      lines.push(
        `f ${vertex(i, j)} ${vertex(i + 1, j)} ${vertex(i + 1, j + 1)} ${vertex(i, j + 1)}`,
      );
  }
  return Buffer.from(lines.join("\n") + "\n");
}
