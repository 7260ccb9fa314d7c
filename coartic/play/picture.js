"use strict";
/* Draws robots and goals on a canvas, in length units. */

/* The box around points with a margin: left, bottom, right, top. */
function around(points, margin = 0) {
  const sides = [0, 1].map((axis) => points.map((point) => point[axis]));
  return [...sides.map((side) => Math.min(...side) - margin), ...sides.map((side) => Math.max(...side) + margin)];
}

const PRINTED = 3; // pixels per CSS pixel in print

class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  /* A colour of the page by the name of its variable. */
  colour(name) {
    return getComputedStyle(this.canvas).getPropertyValue(`--${name}`).trim();
  }

  /* Start a new drawing that shows a box of the world. */
  begin([left, bottom, right, top]) {
    const { canvas, context } = this;
    const density = this.density || (window.matchMedia("print").matches ? PRINTED : window.devicePixelRatio || 1);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const pixels = { width: Math.round(width * density), height: Math.round(height * density) };
    if (canvas.width !== pixels.width || canvas.height !== pixels.height) Object.assign(canvas, pixels);
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

  line(points, width, dash) {
    this.path(points.map((point) => this.toScreen(point)), width, dash);
  }

  path(points, width, dash = []) {
    const { context } = this;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.beginPath();
    points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.setLineDash([]);
  }

  /* A grid with lines every `unit` length units, and a scale bar. */
  grid(unit, colour, ink) {
    const { context, size, scale } = this;
    const [left, top] = this.toWorld([0, 0]);
    const [right, bottom] = this.toWorld(size);
    context.strokeStyle = colour;
    context.globalAlpha = 0.45;
    for (let k = Math.ceil(left / unit); k * unit <= right; k += 1) this.line([[k * unit, bottom], [k * unit, top]], 0.5);
    for (let k = Math.ceil(bottom / unit); k * unit <= top; k += 1) this.line([[left, k * unit], [right, k * unit]], 0.5);
    context.globalAlpha = 1;
    context.strokeStyle = ink;
    const [from, to] = [12, 12 + unit * scale].map((x) => this.toWorld([x, size[1] - 12]));
    this.line([from, to], 1.5);
    this.text(pluralize(unit, "length unit"), [18 + unit * scale, size[1] - 12], ink, "left", 12);
  }

  /* The rail on which the base slides, below or next to it. */
  rail([x, y], off, level, colour) {
    const [[left, top], [right, bottom]] = [[0, 0], this.size].map((point) => this.toWorld(point));
    this.context.strokeStyle = colour;
    this.line(level ? [[left, y - off], [right, y - off]] : [[x, bottom], [x, top]], 3);
  }

  /* A robot. The chosen arm is thick; joints of the left arm are squares, joints of the right arm circles. */
  robot(problem, q, { colour, alpha = 1, weight = 1, chosen = null, thin = false }) {
    const { context } = this;
    const unit = Math.max(1.6, Math.min(3, this.scale / 26)) * weight;
    const [width, height] = problem.robot.base_size;
    context.globalAlpha = alpha;
    context.strokeStyle = colour;
    context.fillStyle = this.colour("base");
    context.lineWidth = thin ? 0.7 : unit * 0.7;
    context.beginPath();
    context.roundRect(...this.toScreen([q[0] - width / 2, q[1] + height / 2]), width * this.scale, height * this.scale, 3);
    if (!thin) context.fill();
    context.stroke();
    problem.hands.forEach((hand) => {
      const places = joint_positions(problem, q, hand);
      if (thin) {
        this.line(places, 1);
        return;
      }
      const points = places.map((point) => this.toScreen(point));
      const wide = unit * (chosen === hand && problem.hands.length > 1 ? 1.25 : 1);
      const radius = (k) => wide * (2.6 - (1.5 * k) / (points.length - 1));
      context.fillStyle = colour;
      context.beginPath();
      points.slice(1).forEach((to, k) => {
        const from = points[k];
        const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
        context.moveTo(from[0] - radius(k) * Math.sin(angle), from[1] + radius(k) * Math.cos(angle));
        context.arc(...from, radius(k), angle + Math.PI / 2, angle + 1.5 * Math.PI);
        context.arc(...to, radius(k + 1), angle - Math.PI / 2, angle + Math.PI / 2);
        context.closePath();
      });
      context.fill();
      context.fillStyle = this.colour("page");
      points.slice(0, -1).forEach(([x, y], k) => {
        const r = 0.45 * radius(k);
        context.beginPath();
        if (hand === LEFT) context.rect(x - r, y - r, 2 * r, 2 * r);
        else context.arc(x, y, r, 0, 7);
        context.fill();
      });
    });
    context.globalAlpha = 1;
  }

  trail(points, colour, alpha, dashed) {
    this.context.strokeStyle = colour;
    this.context.globalAlpha = alpha;
    this.line(points, 2, dashed ? [5, 4] : []);
    this.context.globalAlpha = 1;
  }

  goal([x, y], radius, { label, colour, hit, held, movable }) {
    const { context } = this;
    const [px, py] = this.toScreen([x, y]);
    const r = Math.max(2, radius * this.scale); // to scale, but never too small to be seen
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
    context.fillStyle = hit ? colour : this.colour("page");
    context.fill();
    context.strokeStyle = colour;
    context.lineWidth = Math.min(2, r / 2);
    context.stroke();
    context.fillStyle = colour;
    this.text(label, [px + r + 11, py - r - 6], colour, "center", 15, 600);
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
