"""A training run on a thread of its own, while its node's topics and services stay alive."""

from __future__ import annotations

import threading
from collections.abc import Callable

from msrd_ros.learning.harness import Harness


class Stopped(Exception):  # noqa: N818 - a wish, not an error
    """Raised where work goes on that is not wanted any more."""


class TrainingThread:
    """Runs a harness; begins at once.

    Parameters
    ----------
    harness
        What is run. Its events pause it, stop it and ask for checkpoints.
    afterwards
        Done once the harness has run to its end, unless it was stopped; None: nothing. Is given something to
        call from time to time, which raises `Stopped` if the run was stopped.

    Attributes
    ----------
    failure
        What the run ended with, for the thread that looks after it to raise; None while all is well.
    """

    def __init__(
        self, harness: Harness, afterwards: Callable[[Callable[[], None]], None] | None = None
    ) -> None:
        self.harness, self._afterwards = harness, afterwards
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="training")
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """Whether training is not over."""
        return self._thread.is_alive()

    def pause(self) -> None:
        """Wait after the present iteration, with a checkpoint written."""
        self.harness.paused.set()
        self.harness.checkpoint_wanted.set()

    def go_on(self) -> None:
        """End a pause, if there is one."""
        self.harness.paused.clear()

    def close(self) -> None:
        """End training after the present iteration, and keep what was learned."""
        self.harness.stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            self.harness.run()
            if self._afterwards is not None:
                self._look()
                self._afterwards(self._look)
        except Stopped:
            pass  # what was learned by then is kept
        except BaseException as error:  # handed on to the main thread, which raises it
            self.failure = error

    def _look(self) -> None:
        if self.harness.stop.is_set():
            raise Stopped
