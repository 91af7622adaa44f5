"""A command that runs beside Slicer: its progress, its message and its end."""

import queue
import re
import signal
import subprocess
import threading
from typing import Dict, List, Optional

# A line of progress, as "Reading the scan ..".
_STEP = re.compile(r"(\S.*) \.\.")
_INTERRUPTED = 130


class Run:
    """A started command. Its owner calls poll() now and then, which never waits."""

    def __init__(self, words: List[str], environment: Dict[str, str]) -> None:
        """Starts the command. Raises OSError if it cannot be started."""
        self.step = ""
        """Name of the present step."""
        self.status: Optional[int] = None
        """Exit status, once the command has ended."""
        self.is_canceled = False
        self._said: List[str] = []
        self._lines: "queue.Queue[str]" = queue.Queue()
        self._process = subprocess.Popen(
            words, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            encoding="utf-8", errors="replace",
        )
        # The pipe must be read all the time, or the command would wait.
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as pipe:
            for line in pipe:
                self._lines.put(line.rstrip("\n"))

    def poll(self) -> bool:
        """Takes up new lines; true once the command has ended and all its lines are read."""
        ended = not self._reader.is_alive() and self._process.poll() is not None
        while True:
            try:
                line = self._lines.get_nowait()
            except queue.Empty:
                break
            step = _STEP.fullmatch(line)
            if step:
                self.step = step[1]
            elif line:
                self._said.append(line)
        if ended:
            self.status = self._process.returncode
        return ended

    def cancel(self) -> None:
        """Asks the command to stop. torquer-import then removes its unfinished folder."""
        self.is_canceled = True
        self._process.terminate()

    def message(self) -> str:
        """All lines but those of progress."""
        return "\n".join(self._said)

    def error(self) -> Optional[str]:
        """Message of a command that failed, None after success."""
        if self.status == 0:
            return None
        if self.is_canceled and self.status in (_INTERRUPTED, -signal.SIGTERM):
            return "canceled"
        return self.message() or f"the command ended with status {self.status} and without a message; run it in a terminal"
