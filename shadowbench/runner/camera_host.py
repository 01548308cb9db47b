"""The camera pass in its worker: a member of every comparison, since every frame begins with it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.camera_pass import CameraPass
from shadowbench.device.launch import Context
from shadowbench.runner.cache import Cache
from shadowbench.runner.sampling import WARM_BELOW_MS, WarmUp, repeats_for

if TYPE_CHECKING:
    from shadowbench.world import World


class CameraHost:
    """Holds the camera pass of one view."""

    def load(
        self,
        *,
        cache: str,
        entries: dict[str, str],
        camera: str,
        width: int,
        height: int,
        pixel_samples: int,
        layers: int,
        device: str,
        threads: int,
    ) -> dict[str, Any]:
        """Open the world and make the camera pass.

        Args:
            cache: The cache's folder.
            entries: Name of ``world`` in it.
            camera: Name in the world.
            width, height: Picture size [pixels].
            pixel_samples, layers: Samples of every pixel, and most surfaces that each sees.
            device, threads: Where to run.
        """
        world: World = Cache(Path(cache)).open(entries["world"])
        context = Context(device, threads)
        self._camera_pass = CameraPass(
            world, world.cameras[camera], width, height, context, samples=pixel_samples, layers=layers
        )
        return {}

    def warm_up(self, repeats: int | None = None) -> dict[str, Any]:
        """Run outside the clock until the pass is steady; return ``repeats`` within a sample, found unless given."""
        warm_up = WarmUp()
        while not warm_up.is_over:
            warm_up.add(self._run(1))
        self._repeats = repeats_for(self._last_ms) if repeats is None else repeats
        return {"repeats": self._repeats}

    def round(self) -> dict[str, Any]:
        """Take one sample; return ``camera``, the duration of one pass [ms]."""
        if self._last_ms < WARM_BELOW_MS:
            self._run(1)
        return {"camera": self._run(self._repeats)}

    def close(self) -> None:
        """Nothing to close."""

    def _run(self, repeats: int) -> float:
        begin = time.perf_counter()
        for _ in range(repeats):
            self._camera_pass.run()  # synchronises the device
        self._last_ms = (time.perf_counter() - begin) * 1.0e3 / repeats
        return self._last_ms
