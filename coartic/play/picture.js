"use strict";
/* Draws robots and goals on a canvas, in length units. */

/* What is in sight of points, with a margin: left, bottom, right, top. */
function around(points, margin = 0) {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  points.forEach(([x, y]) => {
    box[0] = Math.min(box[0], x - margin);
    box[1] = Math.min(box[1], y - margin);
    box[2] = Math.max(box[2], x + margin);
    box[3] = Math.max(box[3], y + margin);
  });
  return box;
}

class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  /* Colours of the page, by the names of its variables. */
  colour(name) {
    return getComputedStyle(this.canvas).getPropertyValue(`--${name}`).trim();
  }

  /* Begin anew, with a box of the world in sight. */
  begin([left, bottom, right, top]) {
    const { canvas, context } = this;
    const density = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * density) || canvas.height !== Math.round(height * density)) {
      canvas.width = Math.round(width * density);
      canvas.height = Math.round(height * density);
    }
    this.scale = Math.min(width / (right - left), height / (top - bottom));
    this.centre = [(left + right) / 2, (bottom + top) / 2];
    this.size = [width, height];
    context.setTransform(density, 0, 0, density, 0, 0);
    context.globalAlpha = 1;
    context.fillStyle = this.colour("page");
    context.fillRect(0, 0, width, height);
    context.lineJoin = "round";
    context.lineCap = "round";
  }

  toScreen([x, y]) {
    return [this.size[0] / 2 + (x - this.centre[0]) * this.scale, this.size[1] / 2 - (y - this.centre[1]) * this.scale];
  }

  toWorld([x, y]) {
    return [this.centre[0] + (x - this.size[0] / 2) / this.scale, this.centre[1] - (y - this.size[1] / 2) / this.scale];
  }

  line(points, width, dash = []) {
    const { context } = this;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.beginPath();
    points.map((point) => this.toScreen(point)).forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.setLineDash([]);
  }

  /* A grid of length units. */
  grid(colour) {
    const { context, size } = this;
    const [left, top] = this.toWorld([0, 0]);
    const [right, bottom] = this.toWorld(size);
    context.strokeStyle = colour;
    context.globalAlpha = 0.45;
    for (let x = Math.ceil(left); x <= right; x += 1) this.line([[x, bottom], [x, top]], 0.5);
    for (let y = Math.ceil(bottom); y <= top; y += 1) this.line([[left, y], [right, y]], 0.5);
    context.globalAlpha = 1;
  }

  /* A robot; the arm at work is thick. Joints of the left arm are squares, those of the right one circles. */
  robot(problem, q, { colour, alpha = 1, weight = 1, chosen = null, joints = true }) {
    const { context } = this;
    const unit = Math.max(1.6, Math.min(3, this.scale / 26)) * weight;
    const [width, height] = problem.robot.base_size;
    context.globalAlpha = alpha;
    context.strokeStyle = colour;
    const [left, top] = this.toScreen([q[0] - width / 2, q[1] + height / 2]);
    context.lineWidth = unit * 0.7;
    if (weight >= 1) {
      context.fillStyle = this.colour("base");
      context.fillRect(left, top, width * this.scale, height * this.scale);
    }
    context.strokeRect(left, top, width * this.scale, height * this.scale);
    problem.hands.forEach((hand) => {
      const points = joint_positions(problem, q, hand);
      this.line(points, unit * (chosen === hand && problem.hands.length > 1 ? 2.1 : 1.5));
      if (!joints) return;
      points.map((point) => this.toScreen(point)).forEach(([x, y], k) => {
        const r = unit * (k === points.length - 1 ? 1.9 : 1.3);
        context.fillStyle = hand === LEFT ? this.colour("page") : colour;
        context.lineWidth = unit * 0.7;
        context.beginPath();
        if (hand === LEFT) context.rect(x - r, y - r, 2 * r, 2 * r);
        else context.arc(x, y, r, 0, 7);
        context.fill();
        context.stroke();
      });
    });
    context.globalAlpha = 1;
  }

  trail(points, colour, dashed) {
    this.context.strokeStyle = colour;
    this.context.globalAlpha = 0.45;
    this.line(points, 1.4, dashed ? [5, 4] : []);
    this.context.globalAlpha = 1;
  }

  goal([x, y], radius, { label, colour, hit, held, movable }) {
    const { context } = this;
    const [px, py] = this.toScreen([x, y]);
    const r = Math.max(4, radius * this.scale);
    if (movable) {
      context.fillStyle = colour;
      context.globalAlpha = held ? 0.3 : 0.13;
      context.beginPath();
      context.arc(px, py, Math.max(18, 2 * r), 0, 7);
      context.fill();
      context.globalAlpha = 1;
    }
    context.beginPath();
    context.arc(px, py, r, 0, 7);
    context.fillStyle = hit ? this.colour("hit") : this.colour("page");
    context.fill();
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.stroke();
    context.fillStyle = colour;
    context.font = "600 15px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(label, px + r + 11, py - r - 6);
  }

  text(words, [x, y], colour, align = "left", size = 13, weight = 400) {
    const { context } = this;
    context.fillStyle = colour;
    context.font = `${weight} ${size}px system-ui, sans-serif`;
    context.textAlign = align;
    context.textBaseline = "middle";
    context.fillText(words, x, y);
  }
}
