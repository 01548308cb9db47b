"""Pictures inside the page: stored PNG files made small, turned into ``data:`` addresses, within a budget of bytes.

Who wants a picture asks for it and gets its number; when all have asked, :meth:`PicturePool.encode` shares the budget
out. References, results and failure masks come first: each may use its share of what is left, and gets smaller until it
fits. What they leave goes to further pictures (depth maps, error maps, structures), as many as stay legible; the rest
is left out of the page, and the page says so. A picture that is asked for twice is embedded once.

Shaded pictures become lossy WebP, failure masks (:mod:`.masks`) palette PNG.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import IntEnum

from PIL import Image

from shadowbench.errors import StoreError
from shadowbench.report.masks import palette_png

PICTURE_BYTES = 8_000_000
"""What all pictures of one report may take at most; base64 makes a third more of it."""

_PAGE_BYTES, _CASE_BYTES, _LEAST_BYTES = 14_000_000, 11_500, 1_500_000
"""A page, all that a case takes besides its pictures, about, and what pictures get in any case [bytes]."""

MAIN_SHARE = 0.8
"""References, results and masks may take so much of it."""

SMALLEST_FURTHER = 5_000
"""A further picture with less room than this is left out rather than made illegible [bytes]."""

LADDER = ((640, 80), (560, 74), (480, 68), (400, 64), (320, 60), (240, 56), (200, 50))
"""(width at most [pixels], WebP quality), tried from the best; the last is taken whatever it weighs."""

Size = tuple[int, int]
"""Width and height [pixels]."""

Masks = tuple[tuple[str, str], ...]
"""(failure class, artifact) pairs."""


def picture_budget(case_count: int) -> int:
    """Return the bytes that the pictures of a report over so many cases may take, so that the page stays small."""
    left = (_PAGE_BYTES - case_count * _CASE_BYTES) * 3 // 4
    return min(PICTURE_BYTES, max(_LEAST_BYTES, left))


class Priority(IntEnum):
    """Who is served first."""

    REFERENCE = 0
    RESULT = 1
    MASK = 2
    FURTHER = 3


_WEIGHTS = {Priority.REFERENCE: 2.0, Priority.RESULT: 1.0, Priority.MASK: 0.6, Priority.FURTHER: 1.0}


@dataclass
class _Request:
    number: int
    source: str | Masks
    priority: Priority


@dataclass(frozen=True)
class Pool:
    """What became of the requests.

    Attributes:
        addresses: Number -> ``data:image/…`` address.
        left_out: Numbers of pictures for which there was no room.
        lost: Numbers of pictures whose artifact is gone or is no picture.
        reduced_to: Width of the smallest result that had to be made smaller than the first rung allows, 0 for none.
    """

    addresses: dict[int, str] = field(default_factory=dict)
    left_out: frozenset[int] = frozenset()
    lost: frozenset[int] = frozenset()
    reduced_to: int = 0


class PicturePool:
    """Collects requests for pictures, then embeds them."""

    def __init__(self, read: Callable[[str], bytes], byte_budget: int | None = None) -> None:
        """Prepare an empty pool.

        Args:
            read: Gives an artifact's bytes by its name; may raise :class:`StoreError`.
            byte_budget: What all pictures may take together [bytes]; :data:`PICTURE_BYTES` if not given.
        """
        self._read = read
        self._byte_budget = PICTURE_BYTES if byte_budget is None else byte_budget
        self._requests: dict[str | Masks, _Request] = {}

    def picture(self, artifact: str, priority: Priority) -> int:
        """Ask for a shaded picture and return its number; asked for twice, it has the higher priority."""
        return self._ask(artifact, priority)

    def mask(self, parts: Iterable[tuple[str, str]]) -> int:
        """Ask for the failure mask made of (failure class, artifact) pairs and return its number."""
        return self._ask(tuple(parts), Priority.MASK)

    def _ask(self, source: str | Masks, priority: Priority) -> int:
        request = self._requests.setdefault(source, _Request(len(self._requests) + 1, source, priority))
        request.priority = min(request.priority, priority)
        return request.number

    def encode(self) -> Pool:
        """Embed what was asked for."""
        main = [request for request in self._requests.values() if request.priority is not Priority.FURTHER]
        further = [request for request in self._requests.values() if request.priority is Priority.FURTHER]
        fitted = _Fitting(self._read)
        fitted.serve(sorted(main, key=lambda request: request.priority), round(self._byte_budget * MAIN_SHARE))
        left = self._byte_budget - fitted.byte_count
        shown = further[: max(0, left) // SMALLEST_FURTHER]
        fitted.serve(shown, left)
        return Pool(
            fitted.addresses,
            frozenset(request.number for request in further[len(shown) :]),
            frozenset(fitted.lost),
            fitted.reduced_to,
        )


class _Fitting:
    """Encodes pictures one after the other, each within its share."""

    def __init__(self, read: Callable[[str], bytes]) -> None:
        self._read = read
        self._rungs = dict.fromkeys(Priority, 0)
        self.addresses: dict[int, str] = {}
        self.lost: set[int] = set()
        self.byte_count = 0
        self.reduced_to = 0

    def serve(self, requests: list[_Request], byte_budget: int) -> None:
        """Embed pictures that may take ``byte_budget`` together."""
        weight_left = sum(_WEIGHTS[request.priority] for request in requests)
        bytes_left = byte_budget
        for request in requests:
            share = int(max(bytes_left, 0) * _WEIGHTS[request.priority] / weight_left)
            weight_left -= _WEIGHTS[request.priority]
            spent = self._embed(request, share)
            bytes_left -= spent
            self.byte_count += spent

    def _embed(self, request: _Request, share: int) -> int:
        if isinstance(request.source, str):
            image = opened(self._read, request.source)
            if image is None:
                self.lost.add(request.number)
                return 0
            picture = image.convert("RGB")
            width, content = self._fitting(request.priority, share, lambda rung: _webp(picture, rung))
            if request.priority is Priority.RESULT and width < min(image.width, LADDER[0][0]):
                self.reduced_to = min(width, self.reduced_to or width)
            kind = "webp"
        else:
            masks = {name: opened(self._read, artifact) for name, artifact in request.source}
            found = {name: image for name, image in masks.items() if image is not None}
            if not found:
                self.lost.add(request.number)
                return 0
            kind, (_, content) = "png", self._fitting(request.priority, share, lambda rung: _mask(found, rung))
        self.addresses[request.number] = f"data:image/{kind};base64," + base64.b64encode(content).decode("ascii")
        return len(content)

    def _fitting(self, priority: Priority, share: int, encode: Callable[[int], tuple[int, bytes]]) -> tuple[int, bytes]:
        """Return width and bytes of the best rung that fits, or of the last one.

        Neighbouring pictures weigh alike, so the search begins at the last one's rung: down until a picture fits, or
        else up while the next better one can be expected to fit, growing as its area.
        """
        first = rung = self._rungs[priority]
        width, encoded = encode(rung)
        while len(encoded) > share and rung + 1 < len(LADDER):
            rung += 1
            width, encoded = encode(rung)
        while 0 < rung <= first and len(encoded) * (LADDER[rung - 1][0] / LADDER[rung][0]) ** 2 <= share:
            better_width, better = encode(rung - 1)
            if len(better) > share:
                break
            rung, width, encoded = rung - 1, better_width, better
        self._rungs[priority] = rung
        return width, encoded


def opened(read: Callable[[str], bytes], artifact: str) -> Image.Image | None:
    """Return a stored picture, or ``None`` if it is gone or is no picture: the page says so in its place."""
    try:
        image = Image.open(io.BytesIO(read(artifact)), formats=("PNG",))
        image.load()
    except (OSError, StoreError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
    return image


def _webp(image: Image.Image, rung: int) -> tuple[int, bytes]:
    width, quality = LADDER[rung]
    size = _size_within(image.size, width)
    file = io.BytesIO()
    reduced = image if image.size == size else image.resize(size, Image.Resampling.LANCZOS)
    reduced.save(file, format="WEBP", quality=quality, method=2)
    return size[0], file.getvalue()


def _mask(masks: dict[str, Image.Image], rung: int) -> tuple[int, bytes]:
    size = _size_within(next(iter(masks.values())).size, LADDER[rung][0])
    return size[0], palette_png(masks, size)


def _size_within(size: Size, width: int) -> Size:
    width = min(width, size[0])
    return (width, max(1, round(size[1] * width / size[0])))
