"""Pages without their pictures being rendered, which takes most of a page's time: for tests of what is read on them.

Everything is drawn as ever, up to the last step; what a picture looks like is tested in `sections/test_pictures.py`.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

from PIL import Image

from bayesmembrane.report import canvas


def blank(put: Callable[[Any, str, Any], None] = setattr) -> None:
    """Every picture is a white dot from here on."""
    out = io.BytesIO()
    Image.new("RGB", (1, 1), "white").save(out, "png")
    dots = {"png": out.getvalue(), "svg": b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"/>'}
    put(canvas, "_saved", lambda _figure, kind, _metadata: dots[kind])
