"""Find the texts of a drawn figure, and texts in wrong positions."""

import itertools

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text


def texts_of(figure):
    """Return the texts that are drawn.

    Labels of an axis that is off, and labels of ticks that are out of sight, are left out.
    """
    kept = {*figure.findobj(Text)}
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            kept -= {*axis.findobj(Text)}
            low, high = sorted(axis.get_view_interval())
            if axes.axison:
                kept.add(axis.label)
                ticks = (tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high)
                kept |= {tick.label1 for tick in ticks}
    return [text for text in kept if text.get_visible() and text.get_text().strip()]


def misplaced(figure):
    """Return texts that leave the figure, and pairs of texts that overlap by more than a pixel."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent(canvas.get_renderer()).extents)
             for text in texts_of(figure)]  # fmt: skip
    width, height = figure.bbox.extents[2:]
    outside = [
        text
        for text, (left, low, right, high) in boxes
        if min(left, low) < -1 or right > width + 1 or high > height + 1
    ]
    overlapping = [
        (one, other)
        for (one, a), (other, b) in itertools.combinations(boxes, 2)
        if (np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]) > 1).all()
    ]
    return outside, overlapping
