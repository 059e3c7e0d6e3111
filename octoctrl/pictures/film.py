"""A run as a film: GIF and WebP by Pillow, which comes with Matplotlib; MP4 by imageio-ffmpeg."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..carrying.results import Execution
from ..extras import extra
from ..files.writing import written_aside
from .outlines import draw_objects, outlines
from .plots import arm_camera, arm_shape, draw_arm

Picture = NDArray[np.uint8]

PIXELS = 480
PER_SECOND = {".gif": 12.5, ".webp": 25.0, ".mp4": 25.0}
"""Pictures per second of the film, which runs as fast as the arm."""
_COLOURS = 64


def film(run: Execution, path: Path, *, speed: float = 1.0) -> Path:
    """Write a run as a film.

    Parameters
    ----------
    run : Execution
    path : Path
        One of .gif, .webp and .mp4; checked before.
    speed : float
        Of the film over that of the arm.

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If .mp4 is asked for and imageio-ffmpeg is not installed.
    """
    rate = PER_SECOND[path.suffix]
    if path.suffix == ".mp4":
        return _mp4(run, path, rate, speed)
    from PIL import Image

    first, *others = [Image.fromarray(picture) for picture in pictures(run, rate / speed)]
    with written_aside(path) as part:
        if path.suffix == ".gif":
            palette = first.quantize(_COLOURS)
            stills = [still.quantize(palette=palette, dither=Image.Dither.NONE) for still in (first, *others)]
            stills[0].save(part, save_all=True, append_images=stills[1:], duration=round(1000 / rate), loop=0, optimize=True)
        else:
            first.save(part, save_all=True, append_images=others, duration=round(1000 / rate), loop=0, quality=70)
    return path


def _mp4(run: Execution, path: Path, rate: float, speed: float) -> Path:
    ffmpeg = extra("video", "imageio_ffmpeg")
    with written_aside(path) as part:
        writer = ffmpeg.write_frames(str(part), (PIXELS, PIXELS), fps=rate, codec="libx264", quality=6, macro_block_size=16)
        writer.send(None)
        for picture in pictures(run, rate / speed):
            writer.send(picture.tobytes())
        writer.close()
    return path


def pictures(run: Execution, per_second: float) -> Iterator[Picture]:
    """The arm of a run in one frame, at evenly spaced instants of it.

    Parameters
    ----------
    run : Execution
    per_second : float, 1/s
        Pictures per second of the arm's motion.

    Yields
    ------
    (PIXELS, PIXELS, 3) uint8
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    recording, arm = run.recording, run.plan.arm
    camera = arm_camera(run.plan.task.convention.pole)
    flat = 1e3 * recording.points @ camera.T
    margin = 1.5e3 * arm.base_radius
    low, high = flat.min(axis=(0, 1))[:2] - margin, flat.max(axis=(0, 1))[:2] + margin
    middle, half = (low + high) / 2, (high - low).max() / 2
    figure = Figure(figsize=(4.8, 4.8), dpi=PIXELS / 4.8)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    end = float(recording.time[-1])
    for time in np.arange(0.0, end + 0.5 / per_second, 1 / per_second):
        index = int(np.argmin(np.abs(recording.time - time)))
        axes.clear()
        axes.set_axis_off()
        axes.set_xlim(middle[0] - half, middle[0] + half)
        axes.set_ylim(middle[1] - half, middle[1] + half)
        draw_objects(axes, outlines(run, index, camera), np.zeros(2))
        draw_arm(axes, arm_shape(recording, index, arm), camera, np.zeros(3))
        axes.text(0.03, 0.03, f"{min(time, end):.2f} s", transform=axes.transAxes, fontsize=11)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()
