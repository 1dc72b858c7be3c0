"""The studio's scene as a browser draws it."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page

Picture = NDArray[np.int64]
"""(height, width, 3), 0 to 255."""


def shown(page: Page) -> Picture:
    """What is to be seen of the scene now."""
    # Not of the element: that waits until two frames are alike in place, which takes long in software.
    box = page.locator("#scene").bounding_box()
    assert box is not None
    drawn = page.screenshot(clip=box)
    return np.asarray(Image.open(io.BytesIO(drawn)).convert("RGB"), np.int64)


def is_drawn(page: Page) -> bool:
    """Whether table and arm are to be seen."""
    drawn = shown(page)
    return share_of_blue(drawn) > 0.01 and share_of_red(drawn) > 0.003


def share_of_blue(drawn: Picture) -> float:
    """How much of it is blue, as the table is."""
    red, green, blue = np.moveaxis(drawn, 2, 0)
    return float(((blue > red + 60) & (blue > green + 30)).mean())


def share_of_red(drawn: Picture) -> float:
    """How much of it is red, as Sawyer is."""
    red, green, blue = np.moveaxis(drawn, 2, 0)
    return float(((red > 100) & (green < 70) & (blue < 80)).mean())
