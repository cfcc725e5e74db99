"""A decoding process that dies after the first batch of every file whose name begins with NAME, as HOW says.

With "once-" before HOW it dies only where it decodes on all threads.
"""

import os
import signal
import sys
import time

import numpy as np

from linework.files.las import decode_process as decoding

read_las_batches = decoding.read_las_batches


class Panic(BaseException):
    """What the LAZ library raises is no Exception either."""


def dying_decoder_main(channel, arguments):
    """Decode as the real process does, but die; arguments: HOW, NAME."""
    how, name = arguments
    once, how = how.startswith("once-"), how.removeprefix("once-")

    def dying_batches(path, header, *, is_sequential, **settings):
        dies = path.name.startswith(name) and not (once and is_sequential)
        for i, batch in enumerate(read_las_batches(path, header, is_sequential=is_sequential, **settings)):
            if dies and i == 1:
                die(how, channel)
            yield batch

    decoding.read_las_batches = dying_batches
    decoding.decoder_main(channel, [])


def die(how, channel) -> None:
    """End this process in the way asked for."""
    if how.startswith("SIG"):
        os.kill(os.getpid(), signal.Signals[how])
        time.sleep(600)
    elif how == "exit":
        os._exit(3)
    elif how == "memory":
        held = [np.empty(1 << 27, np.uint8) for _ in range(1000)]
        print(len(held))
    elif how == "panic":
        raise Panic("index out of bounds")
    elif how == "fault":
        raise ValueError("a fault of ours")
    elif how in ("hang", "silence"):
        if how == "silence":
            os.closerange(3, 50)
        time.sleep(600)
    elif how.startswith(("{", "unframed")):
        # Without a frame its first 8 bytes are taken for a length
        data = how.encode()
        os.write(channel.fileno(), data) if how[0] == "u" else channel.send(data)
    elif how == "talk":
        for stream in (sys.stderr, sys.stdout):
            for _ in range(300):
                print("x" * 9999, file=stream)
