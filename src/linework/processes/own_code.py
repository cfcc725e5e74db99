"""Own code of a user (functions, methods): sent to worker processes, and identified when a run is resumed.

Functions of notebooks, scripts and closures have no name by which another process could import them: they travel as
bytes that cloudpickle makes, with the places where this process looks for modules.
"""

from __future__ import annotations

import pickle
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from linework.errors import LineworkError, OwnCodeError, UsageError

#: Own objects that a process keeps loaded: a run has a few methods and one ground.
_KEPT = 8
#: Folder of linework itself: frames in it are not the user's.
_HOUSE = Path(__file__).parents[1]


@dataclass(frozen=True, slots=True)
class SentCode:
    """An object with own code, as bytes for another process.

    Parameters
    ----------
    data
        What cloudpickle made of it.
    module_path
        Folders in which the sending process looks for modules.
    """

    data: bytes
    module_path: tuple[str, ...]

    def load(self) -> Any:
        """Return the object; a process loads it once, however many tasks bring it."""
        return _loaded(self.data, self.module_path)


@lru_cache(maxsize=_KEPT)
def _loaded(data: bytes, module_path: tuple[str, ...]) -> Any:
    # Behind what this process has: modules of linework and of the installation stay the same
    sys.path += [folder for folder in module_path if folder not in sys.path]
    return pickle.loads(data)


def sent_code(value: Any, parameter: str) -> SentCode:
    """Return an object in the form in which it is sent to worker processes.

    Parameters
    ----------
    parameter
        What the user calls it: "find_peaks", "ground".

    Raises
    ------
    UsageError
        It cannot be sent; the message names the parameter and the reason.
    """
    import cloudpickle

    try:
        data = cloudpickle.dumps(value)
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(
            f"cannot be sent to worker processes: {reason}", where=parameter,
            advice="open files, connections and locks inside the function instead of keeping them outside",
        ) from error  # fmt: skip
    folders = tuple(str(Path(folder).absolute()) for folder in sys.path)
    return SentCode(data, folders)


def call_own(function: Callable[..., Any], parameter: str, /, *args: Any, **named: Any) -> Any:
    """Return what an own function returns.

    Raises
    ------
    OwnCodeError
        It raised an exception: the message names the parameter, the exception and the line of the user's code.
        Errors of linework pass as they are.
    """
    try:
        return function(*args, **named)
    except (LineworkError, MemoryError):
        raise
    except Exception as error:
        _refuse(error, parameter)


def _refuse(error: Exception, parameter: str) -> NoReturn:
    """Raise the error of an own function that failed, with the place in the user's code."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if _HOUSE not in Path(frame.filename).parents]
    at = own[0] if own else frames[-1]
    for frame in own:
        if "site-packages" not in frame.filename:
            at = frame
    place = f" ({Path(at.filename).name}, line {at.lineno}, in {at.name})"
    text = " ".join(str(error).split())
    raise OwnCodeError(
        f"{type(error).__name__}{': ' if text else ''}{text}{place}", where=parameter
    ) from error
