"""Pages as tests compare them."""

import re


def without_pictures(page: str) -> str:
    """All that is read on a page; pictures may differ in the last digit of a coordinate."""
    return re.sub(r"base64,[^\"]*", "", page)
