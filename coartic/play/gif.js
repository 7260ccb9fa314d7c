"use strict";
/* Writes animated GIFs (GIF89a) of pictures as a canvas gives them: RGBA, four bytes a pixel. */

const GIF_COLOURS = 255; // and one that is transparent: the pixel has not changed

/* LZW as GIF has it: indices of 8 bits, codes of 9 to 12 bits, in blocks of up to 255 bytes. */
function lzw(indices) {
  const [clear, end, most] = [256, 257, 4096];
  const bytes = [];
  let [held, bits, size, next, codes] = [0, 0, 9, 258, new Map()];
  const put = (code) => {
    held |= code << bits;
    for (bits += size; bits >= 8; bits -= 8) {
      bytes.push(held & 255);
      held >>>= 8;
    }
  };
  put(clear);
  let prefix = indices[0];
  for (let i = 1; i < indices.length; i += 1) {
    const key = prefix * 256 + indices[i];
    const known = codes.get(key);
    if (known !== undefined) prefix = known;
    else {
      put(prefix);
      if (next < most) {
        codes.set(key, next);
        next += 1;
        if (next > 1 << size && size < 12) size += 1;
      } else {
        put(clear);
        [size, next, codes] = [9, 258, new Map()];
      }
      prefix = indices[i];
    }
  }
  put(prefix);
  put(end);
  if (bits) bytes.push(held & 255);
  const blocks = [8];
  for (let at = 0; at < bytes.length; at += 255) {
    const block = bytes.slice(at, at + 255);
    blocks.push(block.length, ...block);
  }
  blocks.push(0);
  return blocks;
}

/* A film that grows frame by frame; `blob()` ends it. */
class Film {
  constructor(width, height) {
    Object.assign(this, { width, height, frames: [], nearest: new Map(), palette: [] });
  }

  /* The most frequent colours of a picture, by 5 bits a channel, are those of the film. */
  choose(pixels) {
    const counts = new Map();
    for (let i = 0; i < pixels.length; i += 4) {
      const key = ((pixels[i] >> 3) << 10) | ((pixels[i + 1] >> 3) << 5) | (pixels[i + 2] >> 3);
      const seen = counts.get(key) || { count: 0, colour: [pixels[i], pixels[i + 1], pixels[i + 2]] };
      seen.count += 1;
      counts.set(key, seen);
    }
    const found = [...counts.values()].sort((a, b) => b.count - a.count).slice(0, GIF_COLOURS - 27);
    const steps = [0, 127, 255];
    const spread = steps.flatMap((r) => steps.flatMap((g) => steps.map((b) => [r, g, b]))); // what comes later
    this.palette = [...found.map(({ colour }) => colour), ...spread];
  }

  index(r, g, b) {
    const key = (r << 16) | (g << 8) | b;
    const known = this.nearest.get(key);
    if (known !== undefined) return known;
    let [best, least] = [0, Infinity];
    this.palette.forEach(([pr, pg, pb], k) => {
      const off = (pr - r) ** 2 + (pg - g) ** 2 + (pb - b) ** 2;
      if (off < least) [best, least] = [k, off];
    });
    this.nearest.set(key, best);
    return best;
  }

  /* Add a picture that is shown for so many seconds; only what changes is kept. */
  add(pixels, seconds) {
    const { width, height } = this;
    if (!this.palette.length) this.choose(pixels);
    const now = new Uint8Array(width * height);
    for (let i = 0; i < now.length; i += 1) now[i] = this.index(pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2]);
    let [left, top, right, bottom] = [0, 0, width - 1, height - 1];
    if (this.before) {
      [left, top, right, bottom] = [width, height, -1, -1];
      for (let y = 0; y < height; y += 1) {
        for (let x = 0; x < width; x += 1) {
          if (now[y * width + x] !== this.before[y * width + x]) {
            left = Math.min(left, x);
            right = Math.max(right, x);
            top = Math.min(top, y);
            bottom = y;
          }
        }
      }
      if (right < 0) { // nothing has changed
        this.frames.at(-1).seconds += seconds;
        return;
      }
    }
    const part = new Uint8Array((right - left + 1) * (bottom - top + 1));
    let k = 0;
    for (let y = top; y <= bottom; y += 1) {
      for (let x = left; x <= right; x += 1) {
        const at = y * width + x;
        part[k] = this.before && now[at] === this.before[at] ? GIF_COLOURS : now[at];
        k += 1;
      }
    }
    this.frames.push({ left, top, width: right - left + 1, height: bottom - top + 1, data: Uint8Array.from(lzw(part)), seconds });
    this.before = now;
  }

  blob() {
    const two = (value) => [value & 255, value >> 8];
    const colours = Array.from({ length: 256 }, (_, k) => this.palette[k] || [0, 0, 0]).flat();
    const parts = [
      [..."GIF89a"].map((letter) => letter.charCodeAt(0)), two(this.width), two(this.height), [0xf7, 0, 0], colours,
      [0x21, 0xff, 11, ...[..."NETSCAPE2.0"].map((letter) => letter.charCodeAt(0)), 3, 1, 0, 0, 0], // for ever
    ];
    this.frames.forEach(({ left, top, width, height, data, seconds }) => {
      parts.push([0x21, 0xf9, 4, 5, ...two(Math.max(2, Math.round(100 * seconds))), GIF_COLOURS, 0]);
      parts.push([0x2c, ...two(left), ...two(top), ...two(width), ...two(height), 0], data);
    });
    parts.push([0x3b]);
    return new Blob(parts.map((part) => Uint8Array.from(part)), { type: "image/gif" });
  }
}

if (typeof module !== "undefined") module.exports = { Film };
