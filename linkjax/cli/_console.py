"""The consoles of the command line, and the display of elapsed time."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook, RenderResult
from rich.segment import Segment
from rich.table import Table

from linkjax._compile import progress

LONG = 10.0  # s
WIDE = 140  # columns if the output is not a terminal
console, complaints = Console(), Console(stderr=True)
if not console.is_terminal and "COLUMNS" not in os.environ:
    console.width = WIDE


class _Trimmed:
    """A table without spaces at the ends of its lines, which fill its last column."""

    def __init__(self, table: Table):
        self.table = table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for line in console.render_lines(self.table, options, pad=False):
            while line and not line[-1].text.strip():
                line.pop()
            yield from line[:-1]
            yield from (Segment(each.text.rstrip(), each.style) for each in line[-1:])
            yield Segment.line()


class _Trim(RenderHook):
    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        return [_Trimmed(each) if isinstance(each, Table) else each for each in renderables]


console.push_render_hook(_Trim())


@contextmanager
def elapsed(what: str) -> Iterator[None]:
    """A line with what is done and the elapsed time, shown on a terminal after one second. Elsewhere one line on the
    stream of errors, if compilation takes long."""
    start = time.perf_counter()
    status = console.status(what, spinner="dots") if console.is_terminal else None
    done = threading.Event()

    def tick() -> None:
        if status is None:
            if not done.wait(LONG) and not console.quiet and compiling():
                complaints.print(f"{what}{compiling()}, once for machines of this structure", highlight=False)
            return
        if done.wait(1.0):
            return
        status.start()
        while not done.wait(0.1):
            status.update(f"{what}{compiling()} … {time.perf_counter() - start:.0f} s")
        status.stop()

    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def compiling() -> str:
    """How far compilation is, e.g. ", compiling 12 of 66 programs"; "" where nothing is compiled."""
    done, count = progress()
    return f", compiling: {done} of {count} programs" if done < count else ""
