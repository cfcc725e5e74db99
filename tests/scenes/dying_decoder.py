"""A decoding process that dies: `dying_decoder.py HOW NAME PARENT ADDRESS_BYTES`.

It dies after the first batch of every file whose name begins with NAME, in the way HOW says; with
"once-" before that only where it decodes on all threads.
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from linework.files.las import decode_process as decoding

# Where doctests are collected it is imported with other arguments, or none
HOW, NAME = (*sys.argv[1:3], "", "")[:2]
IS_ONCE, HOW = HOW.startswith("once-"), HOW.removeprefix("once-")
read_las_batches = decoding.read_las_batches


class Panic(BaseException):
    """What the LAZ library raises is no Exception either."""


def is_pipe(link):
    """Whether an open file is a pipe."""
    try:
        return str(link.readlink()).startswith("pipe:")
    except OSError:  # the one that lists them is closed by now
        return False


def die() -> None:
    """End this process in the way asked for."""
    if HOW.startswith("SIG"):
        os.kill(os.getpid(), signal.Signals[HOW])
        time.sleep(600)
    elif HOW == "exit":
        os._exit(3)
    elif HOW == "hang":
        time.sleep(600)
    elif HOW == "memory":
        held = [np.empty(1 << 27, np.uint8) for _ in range(1000)]
        print(len(held))
    elif HOW == "panic":
        raise Panic("index out of bounds")
    elif HOW == "fault":
        raise ValueError("a fault of ours")
    elif HOW == "silence":
        os.closerange(3, 50)
        time.sleep(600)
    elif HOW.startswith("{"):
        # The only pipe of this process that is none of the three standard streams
        (pipe,) = {int(link.name) for link in Path("/proc/self/fd").iterdir() if is_pipe(link)} - {0, 1, 2}
        os.write(pipe, HOW.encode() + b"\n")
    elif HOW == "talk":
        for stream in (sys.stderr, sys.stdout):
            for _ in range(300):
                print("x" * 9999, file=stream)


def dying_batches(path, header, *, is_sequential, **settings):
    """Yield what is to be yielded, and die."""
    dies = path.name.startswith(NAME) and not (IS_ONCE and is_sequential)
    for i, batch in enumerate(read_las_batches(path, header, is_sequential=is_sequential, **settings)):
        if dies and i == 1:
            die()
        yield batch


if __name__ == "__main__":
    decoding.read_las_batches = dying_batches
    decoding.decoder_main(sys.argv[3:])
