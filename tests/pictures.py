"""Figures drawn in memory."""

from matplotlib.backends.backend_agg import FigureCanvasAgg

from galloping.figures.style import styled


def drawn(draw):
    """Pixels of the figure that `draw` returns, in the project's style."""
    with styled(8):
        canvas = FigureCanvasAgg(draw())
        canvas.draw()
        return bytes(canvas.buffer_rgba())
